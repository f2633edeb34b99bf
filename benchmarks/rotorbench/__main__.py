"""Command line of RotorBench."""

import sys
from pathlib import Path


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))  # `python benchmarks/rotorbench`, too
    from rotorbench.run import main

    main()
