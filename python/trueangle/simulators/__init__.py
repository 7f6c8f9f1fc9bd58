"""Models of encoders in other people's simulators: what MuJoCo has no element for."""
