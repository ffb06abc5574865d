"""FMUs made by hand: descriptions to put faults into, and a library in C that misbehaves on demand.

The model is x' = u - x with y = x and the event indicator z = x - 0.5.
"""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from gantrytau_fmu.building.platforms import native

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
FMI2 = (
    HEAD
    + """<fmiModelDescription fmiVersion="2.0" modelName="Lag" guid="{lag-2}" description="first-order lag"
  generationTool="by hand" variableNamingConvention="structured" numberOfEventIndicators="1">
<ModelExchange modelIdentifier="lag"/>
<CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="true">
<SourceFiles><File name="lag.c"/></SourceFiles></CoSimulation>
<UnitDefinitions>
<Unit name="m"><BaseUnit m="1"/><DisplayUnit name="mm" factor="1000"/></Unit>
<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
</UnitDefinitions>
<TypeDefinitions><SimpleType name="Length"><Real unit="m" min="-10" max="10" nominal="2"/></SimpleType></TypeDefinitions>
<DefaultExperiment startTime="0" stopTime="2" tolerance="1e-4" stepSize="0.1"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="1" causality="input"><Real declaredType="Length" start="0.25"/></ScalarVariable>
<ScalarVariable name="k" valueReference="2" causality="parameter" variability="tunable">
<Integer start="3" min="1" max="5"/></ScalarVariable>
<ScalarVariable name="x" valueReference="3" initial="exact"><Real unit="m" start="1"/></ScalarVariable>
<ScalarVariable name="der(x)" valueReference="4"><Real unit="m/s" derivative="3"/></ScalarVariable>
<ScalarVariable name="y" valueReference="5" causality="output" description="what is seen"><Real unit="m"/></ScalarVariable>
<ScalarVariable name="on" valueReference="6" causality="parameter" variability="fixed">
<Boolean start="true"/></ScalarVariable>
<ScalarVariable name="file" valueReference="7" causality="parameter" variability="fixed">
<String start="a.txt"/></ScalarVariable>
</ModelVariables>
<ModelStructure>
<Outputs><Unknown index="5" dependencies="3" dependenciesKind="constant"/></Outputs>
<Derivatives><Unknown index="4"/></Derivatives>
<InitialUnknowns><Unknown index="4"/><Unknown index="5"/></InitialUnknowns>
</ModelStructure>
</fmiModelDescription>
"""
)
FMI3 = (
    HEAD
    + """<fmiModelDescription fmiVersion="3.0" modelName="Lag" instantiationToken="{lag-3}" generationTool="by hand">
<ModelExchange modelIdentifier="lag"/>
<CoSimulation modelIdentifier="lag" canGetAndSetFMUState="true" canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions>
<Unit name="m"><BaseUnit m="1"/></Unit>
<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
</UnitDefinitions>
<TypeDefinitions><Float64Type name="Length" unit="m" min="-10" max="10"/></TypeDefinitions>
<DefaultExperiment startTime="0" stopTime="2" stepSize="0.1"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="u" valueReference="1" causality="input" declaredType="Length" start="0.25"/>
<Float64 name="p" valueReference="2" causality="parameter" variability="fixed" start="1 2 3 4 5 6">
<Dimension start="2"/><Dimension start="3"/></Float64>
<Float64 name="x" valueReference="3" initial="exact" unit="m" start="1"/>
<Float64 name="der(x)" valueReference="4" unit="m/s" derivative="3"/>
<Float64 name="y" valueReference="5" causality="output" unit="m"><Alias name="seen"/></Float64>
<Float64 name="z" valueReference="6"/>
</ModelVariables>
<ModelStructure>
<Output valueReference="5" dependencies="3"/>
<ContinuousStateDerivative valueReference="4" dependencies="3 1" dependenciesKind="constant constant"/>
<InitialUnknown valueReference="4"/><InitialUnknown valueReference="5"/>
<EventIndicator valueReference="6"/>
</ModelStructure>
</fmiModelDescription>
"""
)
TERMINALS = (
    HEAD
    + """<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>
<Terminal name="port" matchingRule="plug" terminalKind="shaft" description="where it is seen">
<TerminalMemberVariable variableKind="signal" memberName="in" variableName="u"/>
<Terminal name="inner" matchingRule="none"><TerminalMemberVariable variableKind="signal" variableName="y"/></Terminal>
</Terminal></Terminals></fmiTerminalsAndIcons>
"""
)
BUILD = (
    HEAD
    + """<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="lag">
<SourceFileSet language="C99"><SourceFile name="lag.c"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>
"""
)

CODE = r"""
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
typedef struct { double v[7]; int steps; void *env; void (*log)(void *, int, const char *, const char *); } I;
#ifdef CRASH
#define TROUBLE abort();
#elif defined HANG
#define TROUBLE for (volatile int k = 0;;) k++;
#elif defined LEAVE
#define TROUBLE exit(0);
#elif defined FAIL
#define TROUBLE { m->log(m->env, 3, "logStatusError", "the spring broke"); return 3; }
#else
#define TROUBLE
#endif
#ifdef OLD
const char *fmi3GetVersion(void) { return "3.0-beta.2"; }
#elif defined OTHER
const char *fmi3GetVersion(void) { return "2.0"; }
#else
const char *fmi3GetVersion(void) { return "3.0"; }
#endif
static void derive(I *m) { double *v = m->v; v[4] = v[1] - v[3]; v[5] = v[3]; v[6] = v[3] - 0.5; }
static I *make(void *env, void *log) {
    I *m = calloc(1, sizeof(I)); m->v[1] = 0.25; m->v[3] = 1; m->env = env; m->log = log; derive(m);
    printf("noise\n"); fflush(stdout);
#ifdef REFUSE
    return NULL;
#endif
    return m;
}
void *fmi3InstantiateModelExchange(const char *n, const char *token, const char *where, _Bool v, _Bool on,
    void *env, void *log) {
    return make(env, log); }
void *fmi3InstantiateCoSimulation(const char *n, const char *token, const char *where, _Bool v, _Bool on, _Bool events,
    _Bool early, const unsigned *r, size_t nr, void *env, void *log, void *update) { return make(env, log); }
void fmi3FreeInstance(I *m) { free(m); }
int fmi3EnterInitializationMode(I *m, _Bool td, double tol, double begin, _Bool sd, double stop) { return 0; }
int fmi3ExitInitializationMode(I *m) { return 0; }
int fmi3EnterEventMode(I *m) { return 0; }
int fmi3Terminate(I *m) { return 0; }
int fmi3GetFloat64(I *m, const unsigned *r, size_t n, double *x, size_t nx) {
    if (n == 1 && r[0] == 2) { for (size_t k = 0; k < nx; k++) x[k] = k + 1; return 0; }
    for (size_t k = 0; k < n; k++) {
#ifdef UNREADABLE
        if (r[k] == 6) { m->log(m->env, 3, "logStatusError", "no variable 6"); return 3; }
#endif
        x[k] = m->v[r[k]];
#ifdef NOT_FINITE
        if (r[k] == 5) x[k] = 0.0 / 0.0 * m->v[3];
#endif
    }
    return 0; }
int fmi3UpdateDiscreteStates(I *m, _Bool *again, _Bool *end, _Bool *nominals, _Bool *values, _Bool *next, double *time) {
    *end = *nominals = *values = *next = 0; *time = 0;
#ifdef ENDLESS
    *again = 1;
#else
    *again = m->steps++ < 2;
#endif
    return 0; }
int fmi3EnterContinuousTimeMode(I *m) { return 0; }
int fmi3CompletedIntegratorStep(I *m, _Bool no, _Bool *event, _Bool *end) { *event = 1; *end = 0; return 0; }
int fmi3SetTime(I *m, double t) { m->v[0] = t; return 0; }
int fmi3SetContinuousStates(I *m, const double *x, size_t n) { m->v[3] = x[0]; derive(m); return 0; }
int fmi3GetContinuousStates(I *m, double *x, size_t n) { x[0] = m->v[3]; return 0; }
int fmi3GetContinuousStateDerivatives(I *m, double *x, size_t n) {
    x[0] = m->v[4];
#ifdef NOT_FINITE
    x[0] = 1 / (m->v[0] - m->v[0]);
#endif
    return 0; }
int fmi3GetEventIndicators(I *m, double *x, size_t n) { x[0] = m->v[6]; return 0; }
int fmi3GetNumberOfContinuousStates(I *m, size_t *n) { *n = 1; return 0; }
int fmi3GetNumberOfEventIndicators(I *m, size_t *n) {
#ifdef UNCOUNTED
    *n = 5; return 0;
#endif
    *n = 1; return 0; }
int fmi3GetFMUState(I *m, void **s) { *s = malloc(sizeof(I)); memcpy(*s, m, sizeof(I)); return 0; }
#ifdef FORGETFUL
int fmi3SetFMUState(I *m, void *s) { return 0; }
#else
int fmi3SetFMUState(I *m, void *s) { memcpy(m, s, sizeof(I)); return 0; }
#endif
int fmi3FreeFMUState(I *m, void **s) { free(*s); *s = NULL; return 0; }
#ifndef NO_STEPS
int fmi3DoStep(I *m, double t, double h, _Bool no, _Bool *event, _Bool *end, _Bool *early, double *last) {
    TROUBLE
    *event = *end = *early = 0; *last = t + h; m->v[3] += h * m->v[4]; m->v[0] = t + h; derive(m); return 0; }
#endif
"""


def pack(path: Path, members: dict[str, str | bytes]) -> Path:
    """Write an FMU from names and contents."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def lag2(path: Path, description: str = FMI2) -> Path:
    """An FMU of FMI 2 without binaries."""
    return pack(path, {"modelDescription.xml": description, "sources/lag.c": "", "resources/a.txt": "a"})


def lag3(path: Path, description: str = FMI3, terminals: str = TERMINALS, build: str = BUILD) -> Path:
    """An FMU of FMI 3 without binaries."""
    members = {
        "modelDescription.xml": description,
        "sources/lag.c": "",
        "sources/buildDescription.xml": build,
    }
    return pack(path, {**members, "terminalsAndIcons/terminalsAndIcons.xml": terminals})


def running3(path: Path, *faults: str) -> Path:
    """An FMU of FMI 3 with a library that has these faults (names in `CODE`)."""
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None or sys.platform == "win32":
        pytest.skip("no C compiler")
    source, library = path.with_suffix(".c"), path.with_suffix(".so")
    source.write_text(CODE + _stubs())
    command = [
        compiler,
        "-shared",
        "-fPIC",
        "-w",
        *(f"-D{fault}" for fault in faults),
        str(source),
        "-o",
        str(library),
    ]
    subprocess.run(command, check=True, capture_output=True)
    here = native()
    return pack(
        path,
        {"modelDescription.xml": FMI3, f"binaries/{here.folder_3}/lag{here.suffix}": library.read_bytes()},
    )


def _stubs() -> str:
    """The functions of FMI 3 that the model does not need."""
    from fmpy.fmi3 import FMU3Model, FMU3Slave

    names = {name for kind in (FMU3Model, FMU3Slave) for name in dir(kind) if name.startswith("fmi3")}
    return "\n".join(f"int {name}(void) {{ return 3; }}" for name in sorted(names) if f"{name}(" not in CODE)
