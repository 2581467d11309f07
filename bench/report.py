"""Bring the tables in docs/ up to date: `python -m bench.report`, after the benchmarks have been run.

Between `<!-- results: NAME -->` and `<!-- end -->` it puts what `bench/results/NAME.json` holds.
"""

from __future__ import annotations

import re

from bench.measure import RESULTS, ROOT, Report

DOCUMENTS = [ROOT / "docs" / name for name in ("benchmarks.md", "accelerators.md", "extending.md")]
PLACE = re.compile(r"(<!-- results: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    def filled(place: re.Match[str]) -> str:
        path = RESULTS / f"{place[2]}.json"
        if not path.exists():
            print(f"left as they are: the figures of bench.{place[2]}, which has not been run")
            return place[0]
        return f"{place[1]}\n{markdown(Report.read(path))}\n{place[3]}"

    for document in DOCUMENTS:
        content, count = PLACE.subn(filled, document.read_text())
        document.write_text(content)
        print(f"{count} places in docs/{document.name}")


def markdown(report: Report) -> str:
    """The command, the machine, and the tables."""
    machine = report.machine
    versions = ", ".join(f"{package} {machine[package]}" for package in ("python", "numpy", "llvmlite", "embreex"))
    lines = [
        f"`{report.command}`, {report.rounds} rounds; {machine['processor']}, {machine['cores']} cores, "
        f"{machine['lanes']} lanes; {machine['system']}; {versions}; load {machine['load']} when it began.",
        *(table.markdown() for table in report.tables),
    ]
    return "\n\n".join(lines)


if __name__ == "__main__":
    main()
