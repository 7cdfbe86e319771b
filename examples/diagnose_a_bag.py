"""Find which physics a model leaves out on a recording.

python examples/diagnose_a_bag.py my_bag diagnosis
"""

import argparse

from model_discrepancy.diagnose import diagnose


def main() -> None:
    """Read the command line, diagnose, show the verdict."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag")
    parser.add_argument("out", help="new folder for report.html, verdict.json and model.yaml")
    asked = parser.parse_args()

    found = diagnose(asked.bag, asked.out, progress=lambda step: print(f"... {step}"))
    print(f"verdict: {found.verdict.verdict}")
    for effect in found.verdict.effects:
        print(f"{effect['name']}: {effect['sentence']}")
    for reason in found.verdict.reasons:
        print(reason)


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError) as error:  # a wrong bag, model or path
        raise SystemExit(f"error: {error}") from None
