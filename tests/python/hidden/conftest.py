"""The ordinary run diagnoses every second reading of rich questions, the night all of them.

That halves the chi-square of what is hidden (`Question.visible`): in the fixed cases it is 64 at
least then, of a weak error of the gear under load, 300 of the next; 25 is what can be named at all.
"""

import os

from . import answer

if os.environ.get("TRUEANGLE_NIGHTLY") != "1" and not os.environ.get("TRUEANGLE_EXAM_SEEDS"):
    answer.EVERY = 2
