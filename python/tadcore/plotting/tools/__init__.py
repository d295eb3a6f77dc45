"""What figures share: axes, labels, insets, the ends of runs, outcome colours, style and files."""
