"""Counts test cases in JUnit XML files, as gtest, rosunit and roslaunch-check write them.

usage: count_cases.py DIRECTORY

Reads every .xml file below DIRECTORY and prints two numbers: cases passed and cases failed.
Cases that were skipped or disabled count as neither. A file that is not XML (the program
died while writing it) counts as one failed case.
"""

import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def count(path):
    """Returns (passed, failed) for one file."""
    try:
        cases = list(ElementTree.parse(path).iter('testcase'))
    except ElementTree.ParseError:
        return 0, 1
    passed = failed = 0
    for case in cases:
        if case.find('failure') is not None or case.find('error') is not None:
            failed += 1
        elif case.find('skipped') is None and case.get('status') != 'notrun':
            passed += 1
    return passed, failed


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    files = list(pathlib.Path(sys.argv[1]).rglob('*.xml'))
    # rostest writes rosunit-*.xml with the cases, and rostest-*.xml that sums them up.
    if any(file.name.startswith('rosunit-') for file in files):
        files = [file for file in files if not file.name.startswith('rostest-')]
    counts = [count(file) for file in files]
    print(sum(passed for passed, _ in counts), sum(failed for _, failed in counts))


if __name__ == '__main__':
    main()
