"""Every type of page, made with the present code and checked by a browser: `python -m tests.pages OUT`."""
