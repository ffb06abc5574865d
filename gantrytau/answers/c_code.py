"""C source of any CasADi function, such as those of `Dae.function` and `extract_mechanism`, and its derivatives."""

import re
from collections.abc import Sequence

import casadi as ca

from gantrytau.border.checks import whole
from gantrytau.border.refusal import Given, ModelError

KEYWORDS = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while main"
)
NO_CODE = re.compile(r"#error Code generation not supported for (.*)")


def c_source(
    function: ca.Function,
    *,
    name: str | None = None,
    given: Sequence[str] = (),
    find: Sequence[str] = (),
    jacobian: bool = False,
    forward: int = 0,
    reverse: int = 0,
    header: str = "",
) -> str:
    """ISO C (C99) of a function, as text; no file is written.

    name: of the C function (its own); given, find: the model's names of arguments and results, for the table in the
    comment that opens the text; jacobian: also `jac_<name>`; forward, reverse: also `fwd<n>_<name>`, `adj<n>_<name>` for
    so many directions at once; header: lines for that comment. Newton iterations are written out. What switches follows
    its condition in every call, with the derivatives of that side; nothing is kept between calls, so that what is sampled
    or done `when` has no such function, but the C of an FMU (`sources/` in it). Each function is called as CasADi calls it,
    `int name(const double **arg, double **res, long long *iw, double *w, int mem)`. Raises ModelError for a name that C does
    not allow, wrong numbers of names or directions, and what has no C code.
    """
    for word, count in (("forward", forward), ("reverse", reverse)):
        whole("c_source", word, count, least=0)
    name = name if name is not None else str(function.name())
    if not ca.Function.check_name(name) or name in KEYWORDS.split():
        words = "expected a C identifier that starts with a letter, without '__'; give another"
        raise ModelError(words, place="c_source", found=Given("name", name))
    for word, names, count in (("given", given, function.n_in()), ("find", find, function.n_out())):
        if isinstance(names, str) or (names and len(names) != count):
            words = f"expected a list of {count} names, one for each"
            raise ModelError(words, place="c_source", found=Given(word, names))
    base = _renamed(function, name)
    functions = [base]
    functions += [base.jacobian()] if jacobian else []
    functions += [base.forward(forward)] if forward else []
    functions += [base.reverse(reverse)] if reverse else []
    spoken = dict(zip(base.name_in(), given, strict=False)) | dict(zip(base.name_out(), find, strict=False))
    return _comment(header, functions, spoken) + _generated(functions)


def _generated(functions: Sequence[ca.Function]) -> str:
    """What CasADi generates; ModelError if part of it has no code."""
    generator = ca.CodeGenerator(f"{functions[0].name()}.c")
    try:
        for function in functions:
            generator.add(function)
        source = generator.dump()
    except RuntimeError as error:  # raised for some of them, a line in the text for others
        source = f"#error Code generation not supported for {str(error).splitlines()[0]}"
    missing = NO_CODE.search(source)
    if missing is None:
        return source
    raise ModelError(
        f"c_source: {functions[0].name()} contains what has no C code ({missing[1]}), expected closed forms and Newton "
        "iterations; extract a function without it"
    )


def _renamed(function: ca.Function, name: str) -> ca.Function:
    inside = function.sx_in() if function.is_a("SXFunction") else function.mx_in()
    return ca.Function(
        name, inside, function.call(inside, True, False), function.name_in(), function.name_out()
    )


def _comment(header: str, functions: Sequence[ca.Function], spoken: dict[str, str]) -> str:
    """Which argument and result is what, for people."""
    lines = header.splitlines()
    for function in functions:
        lines += ["", f"{function.name()}"]
        for word, names, shape in (
            ("arg", function.name_in(), function.size_in),
            ("res", function.name_out(), function.size_out),
        ):
            for place, name in enumerate(names):
                sparse = function.sparsity_in(place) if word == "arg" else function.sparsity_out(place)
                rows, columns = shape(place)
                stored = "" if sparse.is_dense() else f", {sparse.nnz()} nonzeros stored"
                model = f"  {spoken[name]}" if name in spoken else ""
                lines.append(f"  {word}[{place}]  {name} ({rows}, {columns}){stored}{model}")
    text = "\n".join(f" * {line}".rstrip() for line in lines).replace("*/", "* /")
    return f"/*\n{text}\n */\n"
