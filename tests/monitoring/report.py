"""Checks the layout of reports on runs in a headless Chromium: report.py PAGE..."""

import argparse
import pathlib
import sys

from browser import Failure, chromium
from layout import describe, misfits


def main():
    parser = argparse.ArgumentParser(description="Checks the layout of reports on runs in a headless Chromium.")
    parser.add_argument("pages", nargs="+", type=pathlib.Path, help="HTML files")
    parser.add_argument("--chromium", default="chromium", help="the Chromium program")
    arguments = parser.parse_args()
    try:
        with chromium(arguments.chromium) as page:
            for path in arguments.pages:
                page.open(path.resolve().as_uri())
                wrong = misfits(page) + [text for text, _ in page.errors]
                if wrong:
                    raise Failure(f"{path}: " + "\n".join(wrong))
                print(f"ok      {path.name} fits {describe()}", flush=True)
    except Failure as failure:
        sys.exit(f"report.py: {failure}")


if __name__ == "__main__":
    main()
