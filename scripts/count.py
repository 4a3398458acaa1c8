"""Counts the tests in JUnit files, of ctest and of pytest, and closes with `N passed, N failed`; exit code 1 unless all
passed.

A program that ends its output with such a line itself (the unit tests: one for each test case) counts with its
numbers, any other as one test. One that failed as a whole counts at least one failure, and so does a file without any.
"""
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
        ok = test.get("status", "run") == "run" and test.find("failure") is None and test.find("error") is None
        own = re.findall(r"^(\d+) passed, (\d+) failed$", test.findtext("system-out") or "", re.MULTILINE)
        p, f = map(int, own[-1]) if own else (int(ok), int(not ok))
        passed += p
        failed += max(f, int(not ok))
    return passed, failed if tests else 1


found = [counts(path) for path in sys.argv[1:]]
passed, failed = (sum(column) for column in zip(*found))
print(f"{passed} passed, {failed} failed")
sys.exit(failed > 0)
