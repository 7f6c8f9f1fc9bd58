"""What an error follows: functions of place, direction, speed, load ..., whatever their names."""
