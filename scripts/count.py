"""Counts the tests in JUnit files, of ctest and of pytest, and closes with `N passed, N failed`; exit code 1 unless all
passed.

A program that ends its output with such a line itself (the unit tests: one for each test case) counts with its
numbers, any other as one test. One that failed as a whole counts at least one failure, and so does a file without any. Tests
that were skipped count as neither; how many and why is said above that line.
"""
import collections
import re
import sys
import xml.etree.ElementTree as xml


def counts(path):
    """(passed, failed) of one file."""
    try:
        tests = list(xml.parse(path).getroot().iter("testcase"))
    except (OSError, xml.ParseError) as error:
        print(f"no results: {error}", file=sys.stderr)
        return 0, 1
    passed = failed = 0
    for test in tests:
        skipped = test.find("skipped")
        if skipped is not None and test.get("status") is None:  # of pytest; what ctest does not run has failed
            why[skipped.get("message", "")] += 1
            continue
        ok = test.get("status", "run") == "run" and test.find("failure") is None and test.find("error") is None
        own = re.findall(r"^(\d+) passed, (\d+) failed$", test.findtext("system-out") or "", re.MULTILINE)
        p, f = map(int, own[-1]) if own else (int(ok), int(not ok))
        passed += p
        failed += max(f, int(not ok))
    return passed, failed if tests else 1


why = collections.Counter()
found = [counts(path) for path in sys.argv[1:]]
passed, failed = (sum(column) for column in zip(*found))
for reason, times in why.items():
    print(f"{times} skipped: {reason}")
print(f"{passed} passed, {failed} failed")
sys.exit(failed > 0)
