"""The checks that `tadcore.verify` runs, one module for each theorem or kind of record."""
