"""`python -m kolsky.cli`."""

from kolsky.cli.commandline import main

if __name__ == "__main__":
    main()
