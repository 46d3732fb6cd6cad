"""A registration in six lines: register.py STUDY_FOLDER"""

import sys

import isoshift

study = isoshift.load_study(sys.argv[1])
result = isoshift.register(study)
print(result.verdict, *result.reasons, sep="\n  ")
print(result.setup_error.round(3))
