"""Counts the tests in a JUnit file of ctest and closes with `N passed, N failed`; exit code 1 unless all passed.

A program that ends its output with such a line itself (the unit tests: one for each test case) counts with its
numbers, any other as one test. One that failed as a whole counts at least one failure.
"""
import re
import sys
import xml.etree.ElementTree as xml

try:
    tests = list(xml.parse(sys.argv[1]).getroot().iter("testcase"))
except (OSError, xml.ParseError) as error:
    print(f"ctest left no results: {error}", file=sys.stderr)
    tests = []

passed = failed = 0
for test in tests:
    ok = test.get("status") == "run"
    counts = re.findall(r"^(\d+) passed, (\d+) failed$", test.findtext("system-out") or "", re.MULTILINE)
    p, f = map(int, counts[-1]) if counts else (int(ok), int(not ok))
    passed += p
    failed += max(f, int(not ok))

if not tests:
    failed = 1
print(f"{passed} passed, {failed} failed")
sys.exit(failed > 0)
