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
    """(passed, failed) of one file, and why tests were skipped."""
    try:
        tests = list(xml.parse(path).getroot().iter("testcase"))
    except (OSError, xml.ParseError) as error:
        print(f"no results: {error}", file=sys.stderr)
        return 0, 1, []
    passed = failed = 0
    reasons = []
    for test in tests:
        skipped = test.find("skipped")
        if skipped is not None and test.get("status") is None:  # of pytest; what ctest does not run has failed
            reasons.append(skipped.get("message", ""))
            continue
        ok = test.get("status", "run") == "run" and test.find("failure") is None and test.find("error") is None
        own = re.findall(r"^(\d+) passed, (\d+) failed$", test.findtext("system-out") or "", re.MULTILINE)
        p, f = map(int, own[-1]) if own else (int(ok), int(not ok))
        passed += p
        failed += max(f, int(not ok))
    return passed, failed if tests else 1, reasons


passed, failed, reasons = zip(*map(counts, sys.argv[1:]))
for reason, times in collections.Counter(sum(reasons, [])).items():
    print(f"{times} skipped: {reason}")
print(f"{sum(passed)} passed, {sum(failed)} failed")
sys.exit(sum(failed) > 0)
