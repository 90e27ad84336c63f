"""`kolsky open`: browser pages on this computer to set up, run, view and compare shots."""
