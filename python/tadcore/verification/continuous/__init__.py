"""The game in continuous time: by its event times, with sliding modes."""
