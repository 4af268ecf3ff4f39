"""Names that programs of pysoem use, checked against the package: python3 pysoem_names.py PAGE.

Each block of Python on the page is parsed. Where pysoem is installed, each attribute of the module, of a Master and of a
SubDevice has to exist there. Exit status 1 with the first that does not.
"""

import ast
import re
import sys

try:
    import pysoem
except ImportError:
    pysoem = None


def owner(node):
    """The class, instance or module that an expression of the page means."""
    text = ast.unparse(node)
    if text == "pysoem":
        return pysoem
    if text == "master":
        return pysoem.Master()
    if text in ("buttons", "lamps", "drive") or re.fullmatch(r"master.slaves\[\d+\]", text):
        return pysoem.CdefSlave
    return None


blocks = re.findall(r"^```python\n(.*?)^```$", open(sys.argv[1]).read(), re.M | re.S)
assert blocks, "no Python on the page"
names = 0
for block in blocks:
    for node in ast.walk(ast.parse(block)):
        if pysoem and isinstance(node, ast.Attribute) and (found := owner(node.value)):
            assert hasattr(found, node.attr), f"pysoem has no {ast.unparse(node)}"
            names += 1
print(f"{len(blocks)} blocks, {names} names" if pysoem else f"{len(blocks)} blocks, names not checked: no pysoem")
