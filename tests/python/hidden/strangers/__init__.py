"""A blind exam of `diagnose`, written by someone who had not read its code.

It holds 59 cases of 22 forms that no cause names, 25 named causes at four sizes, pairs of a strong
and a weak one, and readings with nothing hidden: 144 cases a seed. Generators are numpy alone.
Forms, designs, noise and the judge's rules are the stranger's and stay as they are; the one
correction of a truth is `causes.SAME_FUNCTION`.

First results: before a diagnosis stated factors, 29 % of the forms got a false confirmed name. With
factors 14 % did, before anything was tuned. First result of a new seed, 23, once a dent in one
direction and late readings were functions of the account: 58 of 59 forms truthful, one with a false
confirmed name, and none among the other 83 cases.
"""
