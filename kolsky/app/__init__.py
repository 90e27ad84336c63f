"""`kolsky open`: pages in the browser on this computer to set up, run, look at and compare shots."""
