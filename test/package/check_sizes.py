#!/usr/bin/env python3
"""No source file is longer than 350 lines, and no C++ function than 60. Argument: the project's folder."""
import pathlib
import re
import sys

MOST_LINES_OF_FILE = 350
MOST_LINES_OF_FUNCTION = 60
# "FILE", or "FILE: NAME" for a function; an entry that is no longer needed fails the check.
EXCEPTIONS = set()

# Comments, strings and character literals, in which braces mean nothing. Digit separators are no literals.
IGNORED = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])+\'',
                     re.DOTALL)
SCOPE = re.compile(r"\b(namespace|class|struct|union|enum|extern)\b")
NAME = re.compile(r"([\w:~]+|operator\s*\S+)\s*\(")


def functions_of(text):
    """(name, first line, number of lines) of the functions at namespace or class scope, from signature to brace."""
    text = IGNORED.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    text = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda match: re.sub(r"[^\n]", " ", match[0]), text,
                  flags=re.MULTILINE)
    found = []
    inside = []  # of the open braces: "scope", or the name and start of a function, or "other"
    start = 0  # of the current declaration
    for match in re.finditer(r"[{};]", text):
        at_scope = all(kind == "scope" for kind in inside)
        if match[0] == "{":
            declaration = text[start:match.start()]
            name = NAME.search(re.sub(r"^\s*template\s*<.*?>\s*\n", "", declaration, flags=re.DOTALL))
            if not at_scope:
                inside.append("other")
            elif SCOPE.search(declaration.split("(")[0]) or not declaration.strip():
                inside.append("scope")
            elif name and not re.search(r"=\s*$", declaration):
                inside.append((name[1], start + len(declaration) - len(declaration.lstrip())))
            else:
                inside.append("other")
        elif match[0] == "}" and inside:
            kind = inside.pop()
            # Braces of an initialiser, with which the declaration does not end: `f(T x = {}) {`, `F() : x_{1} {`.
            if re.match(r"\s*[{,)]", text[match.end():match.end() + 200]):
                continue
            if isinstance(kind, tuple):
                first = text.count("\n", 0, kind[1]) + 1
                found.append((kind[0], first, text.count("\n", 0, match.start()) + 2 - first))
        if all(kind == "scope" for kind in inside):
            start = match.end()
    return found


def main():
    project = pathlib.Path(sys.argv[1])
    too_long = {}
    functions = 0
    for folder in ("include", "src"):
        for path in sorted((project / folder).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            text = path.read_text()
            name = str(path.relative_to(project))
            if text.count("\n") > MOST_LINES_OF_FILE:
                too_long[name] = f"{text.count(chr(10))} lines, must be <= {MOST_LINES_OF_FILE}"
            for function, line, lines in functions_of(text):
                functions += 1
                if lines > MOST_LINES_OF_FUNCTION:
                    too_long[f"{name}: {function}"] = f"line {line}, {lines} lines, must be <= {MOST_LINES_OF_FUNCTION}"
    if functions < 1000:
        sys.exit(f"found {functions} functions: the check no longer sees what is there")
    problems = [f"{name}: {problem}" for name, problem in too_long.items() if name not in EXCEPTIONS]
    problems += [f"{name}: is an exception that is not needed" for name in sorted(EXCEPTIONS - set(too_long))]
    if problems:
        sys.exit("\n".join(problems))
    print(f"{functions} functions; {len(EXCEPTIONS)} exceptions")


if __name__ == "__main__":
    main()
