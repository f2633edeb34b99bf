"""The equations of motion of a scene, in the forms that analyses and solvers take, and their starts."""
