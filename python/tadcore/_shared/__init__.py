"""What every other part of the package uses: arrays from outside, files, limits and text."""
