"""Every type of page, made with the present code, and looked at by a browser: `python -m tests.pages OUT`."""
