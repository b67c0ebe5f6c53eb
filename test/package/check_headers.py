#!/usr/bin/env python3
"""Every public header can be included alone.

Most headers are the first include of the source file that implements them, so the build has compiled them alone. This
compiles the others. Arguments: the project's folder, the compiler, its include folders of other packages.
"""
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys

project, compiler, folders = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3:]
include = project / "include"

compiled_by_build = set()
for source in (project / "src").rglob("*.cpp"):
    first = re.search(r'^#include [<"]([^>"]+)[>"]', source.read_text(), re.MULTILINE)
    if first:
        compiled_by_build.add(first[1])
headers = [path for path in sorted(include.rglob("*.h"))]
others = [path for path in headers if str(path.relative_to(include)) not in compiled_by_build]
if len(headers) < 50 or len(others) == len(headers):
    sys.exit(f"{len(headers)} headers, {len(others)} to compile: the check no longer finds what is there")


def errors_of(header):
    flags = [flag for folder in folders for flag in ("-isystem", folder)]
    run = subprocess.run([compiler, "-std=c++17", "-fsyntax-only", f"-I{include}", *flags, "-x", "c++", "-"],
                         input=f'#include "{header.relative_to(include)}"\n', capture_output=True, text=True)
    return run.stderr if run.returncode else ""


with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
    errors = [error for error in pool.map(errors_of, others) if error]
if errors:
    sys.exit("\n".join(errors))
print(f"{len(headers)} public headers, of which {len(others)} are no source's first include")
