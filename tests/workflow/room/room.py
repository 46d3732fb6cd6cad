"""What the tests of a treatment room share."""

import sys
import time


def expect(truth, message):
    if not truth:
        sys.exit(message)


def wait_for(condition, seconds, what):
    end = time.time() + seconds
    while time.time() < end:
        if condition():
            return
        time.sleep(0.2)
    sys.exit(f"waited {seconds} s for {what}")
