"""RotorBench: thirty cases with reference numbers, solved by jaxrotor, ROSS and SciPy alone."""
