"""What the equations say, computed again by NumPy and SciPy in the paper's own matrices."""
