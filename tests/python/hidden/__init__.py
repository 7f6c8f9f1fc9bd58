"""A joint with a hidden physical effect, and the exam that asks `diagnose` to find it.

The generator shares no code and no functional form with the library: presliding is a
Maxwell-slip or Bouc-Wen model, springs are piecewise linear, filters are of second order,
drift wanders, bumps are triangles or raised cosines. Only `trueangle.CalibrationRun` is used.
"""
