"""What a reader sees, written into a folder to be looked at: ``python tests/looks [FOLDER]``.

Terminal outputs of every command at 80 columns, and the report (1280 and 390 pixels wide, light
and dark, and printed), the certificate in every language, and the pages of the documentation where
they are built (``make docs``), as pictures. Exit status 1 where a line or a page is too wide.
"""

import sys
from pathlib import Path

from pages import pages
from scenes import furnish, scenes

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = 80


def main(folder):
    """Write everything; the number of things that are too wide."""
    sys.path.append(str(ROOT / "tests" / "python"))
    from transcripts.terminal import ran

    desk = folder / "desk"
    desk.mkdir(parents=True, exist_ok=True)
    furnish(desk)
    wide = []
    for command, lines in scenes().items():
        text = ""
        for line in lines:
            status, *told = ran(line.split(), desk, COLUMNS)
            text += f"$ trueangle {line}\n{''.join(told)}\n"
            rows = "".join(told).splitlines()
            wide += [f"{command}: {row}" for row in rows if len(row) > COLUMNS]
            if status:
                wide.append(f"{line}: exit status {status}")
        (folder / f"{command}.txt").write_text(text, encoding="utf-8")
    wide += pages(folder, desk, ROOT / "docs" / "_build" / "html")
    for entry in wide:
        print(entry)
    print(f"{len(list(folder.glob('*.*')))} files in {folder}, {len(wide)} too wide")
    return len(wide)


if __name__ == "__main__":
    sys.exit(bool(main(Path(sys.argv[1] if sys.argv[1:] else ROOT / "target" / "looks").resolve())))
