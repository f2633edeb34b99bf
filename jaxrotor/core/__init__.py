"""What every room may use and that knows no rotor: quantities, blocks, checks, progress, programs."""
