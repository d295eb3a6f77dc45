"""What every wing uses: arrays from outside, files, limits and text."""
