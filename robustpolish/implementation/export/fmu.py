"""A controller as an FMU for co-simulation (FMI 2.0), compiled here."""

from __future__ import annotations

import math
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

from robustpolish.base.atomic_writes import new_file
from robustpolish.base.versions import __version__
from robustpolish.errors import MissingDependencyError, SolverError
from robustpolish.implementation.export.c import CodeSpec, c_text, identifier, target

# The texts of an FMU: the functions that FMI 2.0 asks for, around a controller in C, and its card.
#
# The declarations follow fmi2TypesPlatform.h, fmi2FunctionTypes.h and fmi2Functions.h, copyright
# 2008-2011 MODELISAR consortium, 2012-2022 Modelica Association Project "FMI", licensed under the
# 2-clause BSD licence (https://fmi-standard.org).

_WRAPPER = r"""
/*
 * The functions of the Functional Mock-up Interface 2.0 for co-simulation. Declared as in
 * the headers of the standard, copyright 2008-2011 MODELISAR consortium, 2012-2022 Modelica
 * Association Project "FMI", under the 2-clause BSD licence, https://fmi-standard.org.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined _WIN32
#define FMI2_EXPORT __declspec(dllexport)
#else
#define FMI2_EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum {
    fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated
} fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#define PERIOD @PERIOD@
#define DELAY @DELAY@
#define QUEUE @QUEUE@
#define NEAR 1e-9
#define GUID "@GUID@"

typedef struct {
    @NAME@_state state;
    double y[@NY@];
    double u[QUEUE][@NU@];
    double acting[@NU@];
    double start;
    double samples;
    double time;
    void (*release)(void *);
} Unit;

/* Return to rest; `samples` counts those that were taken. */
static void rest(Unit *c)
{
    @NAME@_init(&c->state);
    memset(c->y, 0, sizeof c->y);
    memset(c->u, 0, sizeof c->u);
    memset(c->acting, 0, sizeof c->acting);
    c->start = 0.0;
    c->samples = 0.0;
    c->time = 0.0;
}

/* Take the sample that is due. */
static void sample(Unit *c)
{
    memmove(c->u[1], c->u[0], (QUEUE - 1) * sizeof c->u[0]);
    @NAME@_step(&c->state, c->y, c->u[0]);
    c->samples += 1.0;
}

/* Put out the newest control whose delay is over just before `end`. */
static void put_out(Unit *c, double end)
{
    double newest = ceil((end - c->start - DELAY) / PERIOD - NEAR) - 1.0;
    double back = c->samples - 1.0 - newest;
    int i;
    if (newest < 0.0 || c->samples < 1.0) {
        return;
    }
    if (back < 0.0) {
        back = 0.0;
    }
    if (back > QUEUE - 1) {
        back = QUEUE - 1;
    }
    for (i = 0; i < @NU@; i++) {
        c->acting[i] = c->u[(int)back][i];
    }
}

FMI2_EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

FMI2_EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

FMI2_EXPORT fmi2Status fmi2SetDebugLogging(
    fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

FMI2_EXPORT fmi2Component fmi2Instantiate(
    fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Unit *c;
    (void)name, (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, GUID) != 0) {
        return NULL;
    }
    c = (Unit *)functions->allocateMemory(1, sizeof(Unit));
    if (c != NULL) {
        c->release = functions->freeMemory;
        rest(c);
    }
    return c;
}

FMI2_EXPORT void fmi2FreeInstance(fmi2Component component)
{
    Unit *c = (Unit *)component;
    if (c != NULL) {
        c->release(c);
    }
}

FMI2_EXPORT fmi2Status fmi2SetupExperiment(
    fmi2Component component, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean has_stop, fmi2Real stop)
{
    Unit *c = (Unit *)component;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    c->start = start;
    c->time = start;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    rest((Unit *)c);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetReal(
    fmi2Component component, const fmi2ValueReference refs[], size_t n, fmi2Real values[])
{
    const Unit *c = (const Unit *)component;
    size_t i;
    for (i = 0; i < n; i++) {
        if (refs[i] < @NY@) {
            values[i] = c->y[refs[i]];
        } else if (refs[i] < @NY@ + @NU@) {
            values[i] = c->acting[refs[i] - @NY@];
        } else {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetReal(
    fmi2Component component, const fmi2ValueReference refs[], size_t n, const fmi2Real values[])
{
    Unit *c = (Unit *)component;
    size_t i;
    for (i = 0; i < n; i++) {
        if (refs[i] >= @NY@) {
            return fmi2Error;
        }
        c->y[refs[i]] = values[i];
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2DoStep(
    fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean kept)
{
    Unit *c = (Unit *)component;
    double end = time + step;
    (void)kept;
    if (!(step > 0.0)) {
        return fmi2Error;
    }
    while (c->start + c->samples * PERIOD < end - NEAR * PERIOD) {
        sample(c);
    }
    put_out(c, end);
    c->time = end;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}

FMI2_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *v)
{
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *v = ((const Unit *)c)->time;
    return fmi2OK;
}

#define NONE(name, arguments, ...) \
    FMI2_EXPORT fmi2Status name arguments \
    { \
        (void)c, __VA_ARGS__; \
        return fmi2Error; \
    }
#define EMPTY(name, arguments, count) \
    FMI2_EXPORT fmi2Status name arguments \
    { \
        (void)c, (void)r, (void)v; \
        return count == 0 ? fmi2OK : fmi2Error; \
    }

EMPTY(fmi2GetInteger,
      (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[]), n)
EMPTY(fmi2GetBoolean,
      (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean v[]), n)
EMPTY(fmi2GetString,
      (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]), n)
EMPTY(fmi2SetInteger,
      (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer v[]), n)
EMPTY(fmi2SetBoolean,
      (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[]), n)
EMPTY(fmi2SetString,
      (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[]), n)
NONE(fmi2GetFMUstate, (fmi2Component c, fmi2FMUstate *s), (void)s)
NONE(fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate s), (void)s)
NONE(fmi2FreeFMUstate, (fmi2Component c, fmi2FMUstate *s), (void)s)
NONE(fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate s, size_t *n), (void)s, (void)n)
NONE(fmi2SerializeFMUstate,
     (fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n), (void)s, (void)b, (void)n)
NONE(fmi2DeSerializeFMUstate,
     (fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s), (void)b, (void)n, (void)s)
NONE(fmi2GetDirectionalDerivative,
     (fmi2Component c, const fmi2ValueReference a[], size_t n, const fmi2ValueReference b[],
      size_t m, const fmi2Real d[], fmi2Real e[]),
     (void)a, (void)n, (void)b, (void)m, (void)d, (void)e)
NONE(fmi2SetRealInputDerivatives,
     (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
      const fmi2Real v[]),
     (void)r, (void)n, (void)o, (void)v)
NONE(fmi2GetRealOutputDerivatives,
     (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
      fmi2Real v[]),
     (void)r, (void)n, (void)o, (void)v)
NONE(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Status *v), (void)k, (void)v)
NONE(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Integer *v), (void)k,
     (void)v)
NONE(fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v), (void)k,
     (void)v)
NONE(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind k, fmi2String *v), (void)k,
     (void)v)
"""


def wrapper_text(spec: CodeSpec, name: str, guid: str) -> str:
    """Return the functions of FMI around the controller called `name`."""
    fill = {
        "NAME": name,
        "NY": str(len(spec.measurements)),
        "NU": str(len(spec.controls)),
        "PERIOD": repr(float(spec.period)),
        "DELAY": repr(float(spec.delay)),
        "QUEUE": str(math.floor(spec.delay / spec.period) + 3),
        "GUID": guid,
    }
    text = _WRAPPER
    for key, value in fill.items():
        text = text.replace(f"@{key}@", value)
    return text


def description(spec: CodeSpec, name: str, guid: str) -> str:
    """Return modelDescription.xml."""
    used = sorted({spec.units[n] for n in _signals(spec) if spec.units.get(n)})
    units = "".join(f"    <Unit name={quoteattr(unit)}/>\n" for unit in used)
    variables = "".join(_variable(spec, i, signal) for i, signal in enumerate(_signals(spec)))
    ny = len(spec.measurements)
    outputs = "".join(f'      <Unknown index="{ny + i + 1}"/>\n' for i in range(len(spec.controls)))
    block = f"  <UnitDefinitions>\n{units}  </UnitDefinitions>\n" if used else ""
    return f"""\
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(name)} guid={quoteattr(guid)}
  description={quoteattr(" ".join(spec.about))}
  generationTool="robustpolish {__version__}" variableNamingConvention="flat">
  <CoSimulation modelIdentifier={quoteattr(name)} canHandleVariableCommunicationStepSize="true">
    <SourceFiles>
      <File name="{name}.c"/>
    </SourceFiles>
  </CoSimulation>
{block}  <DefaultExperiment startTime="0.0" stepSize="{float(spec.period)!r}"/>
  <ModelVariables>
{variables}  </ModelVariables>
  <ModelStructure>
    <Outputs>
{outputs}    </Outputs>
    <InitialUnknowns>
{outputs}    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


def _signals(spec: CodeSpec) -> tuple[str, ...]:
    return (*spec.measurements, *spec.controls)


def _variable(spec: CodeSpec, index: int, signal: str) -> str:
    is_input = index < len(spec.measurements)
    cause = "input" if is_input else "output"
    unit = spec.units.get(signal)
    inside = (' start="0.0"' if is_input else "") + (f" unit={quoteattr(unit)}" if unit else "")
    kind = "continuous" if is_input else "discrete"
    return (
        f'    <ScalarVariable name={quoteattr(signal)} valueReference="{index}" '
        f'causality="{cause}" variability="{kind}">\n      <Real{inside}/>\n'
        "    </ScalarVariable>\n"
    )


_FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")
_WORDS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("win", "dll")}


def write_fmu(
    spec: CodeSpec, path: str | os.PathLike[str], name: str, *, force: bool = False
) -> Path:
    """Write the FMU; see `SampledDesign.export_fmu`.

    Parameters
    ----------
    spec : CodeSpec
    path : path
        A folder, or a file that ends in ``.fmu``.
    name : str
    force : bool, optional

    Returns
    -------
    pathlib.Path

    Raises
    ------
    MissingDependencyError
        If there is no C compiler.
    SolverError
        If the compiler refuses the source, which a working one does not.
    """
    identifier(name)
    place = target(path, name, ".fmu")
    core = c_text(spec, name, "double")
    # The same controller has the same identity, wherever and whenever it is exported.
    guid = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, core)}}}"
    source = core + wrapper_text(spec, name, guid)
    with new_file(place, force, (".fmu",)) as draft, zipfile.ZipFile(draft, "w") as archive:
        _add(archive, "modelDescription.xml", description(spec, name, guid).encode())
        _add(archive, f"sources/{name}.c", source.encode())
        folder, suffix = _platform()
        _add(archive, f"binaries/{folder}/{name}.{suffix}", _compiled(source, name))
    return place


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    """Add a file with a fixed date, so that the same controller gives the same bytes."""
    entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content, zipfile.ZIP_DEFLATED)


def _platform() -> tuple[str, str]:
    word, suffix = _WORDS.get(sys.platform, ("linux", "so"))
    bits = "64" if sys.maxsize > 2**32 else "32"
    machine = platform.machine().lower()
    if word == "linux" and machine not in ("x86_64", "amd64", "i686", "i386"):
        return f"{machine}-linux", suffix  # as FMI 3.0 and most importers call it
    return word + bits, suffix


def _compiled(source: str, name: str) -> bytes:
    compiler = shutil.which(os.environ.get("CC") or "cc") or shutil.which("gcc")
    if compiler is None:
        raise MissingDependencyError(
            "path: there is no C compiler to build the FMU with. Install gcc or clang, or set CC; "
            "export_c needs none."
        )
    with tempfile.TemporaryDirectory() as folder:
        file, library = Path(folder, f"{name}.c"), Path(folder, f"{name}.bin")
        file.write_text(source, encoding="utf-8")
        command = [compiler, *_FLAGS, "-o", str(library), str(file), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            line = (done.stderr.strip().splitlines() or ["no message"])[0]
            raise SolverError(f"path: {compiler} refused the source: {line}. Try another CC.")
        return library.read_bytes()
