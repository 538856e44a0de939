"""The demonstration: a recording with a concealed effect, and another of the same actuator."""
