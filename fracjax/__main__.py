"""`python -m fracjax`: the program `fracjax`, under another name."""

from ._cli import main

if __name__ == "__main__":
    main()
