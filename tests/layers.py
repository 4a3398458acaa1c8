"""The one-way rule of the source: an include points down, or sideways within its own layer's folder.

usage: layers.py [SOURCE]      ends with exit code 1 where an include breaks the rule, and names it
"""
import os
import re
import sys

# From the bottom up; those on one line are siblings and do not see each other.
LAYERS = [["base"], ["numerics"], ["options"], ["model"], ["time", "stability", "waves", "output"], ["cycles"],
          ["study"], ["commands"]]
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def broken(source):
    """Every forbidden include as a line of text."""
    lines = []
    for root in ("include/stickslip", "src"):
        for folder, _, files in os.walk(os.path.join(source, root)):
            layer = os.path.relpath(folder, os.path.join(source, root)).split(os.sep)[0]
            for name in sorted(files):
                if not name.endswith((".hpp", ".cpp")):
                    continue
                path = os.path.join(folder, name)
                place = os.path.relpath(path, source)
                if layer not in LEVEL:
                    lines.append(f"{place}: belongs to no layer")
                    continue
                with open(path, encoding="utf-8") as file:
                    found = re.findall(r'^\s*#\s*include\s+"([^"]+)"', file.read(), re.MULTILINE)
                for target in found:
                    below = target.removeprefix("stickslip/").split("/")[0]
                    if target == "revision.hpp" and layer == "base":  # generated
                        continue
                    if below not in LEVEL:
                        lines.append(f"{place}: includes {target}, which belongs to no layer")
                    elif below != layer and LEVEL[below] >= LEVEL[layer]:
                        lines.append(f"{place}: includes {target}: {layer} must not see {below}")
    return lines


if __name__ == "__main__":
    found = broken(sys.argv[1] if len(sys.argv) > 1 else os.environ.get("STICKSLIP_SOURCE", "."))
    print("\n".join(found) or "every include points down")
    sys.exit(1 if found else 0)
