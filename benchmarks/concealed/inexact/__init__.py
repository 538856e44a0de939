"""The second tier: recordings whose hysteresis obeys none of the believed laws."""
