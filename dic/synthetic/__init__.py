"""Pictures computed with a known answer, to test what measures them."""
