"""Command line as `python -m jaxrotor`."""

from .cli import main


if __name__ == "__main__":
    main()
