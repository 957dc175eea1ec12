"""``python -m chaosgym`` is the command ``chaosgym``."""

from chaosgym.cli import main

if __name__ == "__main__":
    main()
