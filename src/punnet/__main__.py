"""``python -m punnet`` is the command ``punnet``."""

from punnet.cli import main

__all__: list[str] = []

if __name__ == "__main__":
    main()
