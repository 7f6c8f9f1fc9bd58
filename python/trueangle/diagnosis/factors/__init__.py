"""What an error follows: functions of place, direction, speed, load ..., with or without a name."""
