"""Exported FMUs in the tools of others: they find nothing wrong, run them alike, and read back the same equations."""

import ctypes
import logging
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantrytau import simulate
from tests.families import first_of
from tests.fmu.exported import Exported, Numbers

NAMES = ("pendulum", "filter", "sampled", "three-link", "stick-slip", "six-link")
STEP, STEPS = 0.004, 50


def each(*names: str) -> list[Any]:
    """FMUs by name and version of FMI, each model in one of the two and nightly in the other."""
    versions = {name: (2, 3) if NAMES.index(name) % 2 else (3, 2) for name in names}
    every = [(name, versions[name][k]) for k in range(2) for name in names]
    return first_of((pytest.param(one, id=f"fmi{one[1]}-{one[0]}") for one in every), len(names))


@pytest.fixture(params=each(*NAMES))
def fmu(request, exported) -> Exported:
    return exported(*request.param)


def shown(fmu: Exported) -> list[str]:
    """Some continuous outputs."""
    found = [
        v.name
        for v in fmu.described.modelVariables
        if v.causality == "output" and v.variability == "continuous"
    ]
    return found[:: max(1, len(found) // 12)]


def forces(fmu: Exported) -> dict[str, float]:
    """A value for each input: 20, 10, 20/3 ..."""
    return {n: 20.0 / (k + 1) for k, n in enumerate(fmu.dae.inputs)}


def ours(fmu: Exported) -> np.ndarray:
    """The outputs after STEPS steps, by plain calls."""
    with fmu.new() as run:
        run.begin(**forces(fmu))
        for k in range(STEPS):
            run.time = k * STEP
            run.step(STEP)
        return run[shown(fmu)]


def test_the_description_is_valid(fmu):
    import fmpy
    from fmpy.validation import validate_fmu

    etree: Any = import_module("lxml.etree")
    if len(fmu.references) > 1000:
        # validate_fmu without the grammar of the names, which takes FMPy seconds and which other models show
        fmpy.read_model_description(str(fmu.path), validate=True, validate_model_structure=True)
    else:
        assert validate_fmu(str(fmu.path)) == []
    folder = Path(fmpy.__file__).parent / "schema" / f"fmi{fmu.version}"
    for part, schema in (
        ("modelDescription.xml", f"fmi{fmu.version}ModelDescription.xsd"),
        ("sources/buildDescription.xml", "fmi3BuildDescription.xsd"),
        ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd"),
    ):
        if (fmu.folder / part).exists():
            etree.XMLSchema(etree.parse(folder / schema)).assertValid(etree.parse(fmu.folder / part))


def test_the_manipulation_toolbox_finds_nothing(fmu, caplog):
    """What `fmutool -input model.fmu -check` does, without starting a Python for each file."""
    operations = pytest.importorskip("fmu_manipulation_toolbox.operations")
    checker = pytest.importorskip("fmu_manipulation_toolbox.checker")
    with caplog.at_level(logging.WARNING), operations.FMU(str(fmu.path)) as opened:
        for check in checker.get_checkers():
            opened.apply_operation(check())
    assert [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING] == []


def test_fmpy_steps_it_to_the_same_numbers(fmu):
    from fmpy import simulate_fmu

    names = shown(fmu)
    result = simulate_fmu(
        str(fmu.path),
        fmi_type="CoSimulation",
        stop_time=STEPS * STEP,
        step_size=STEP,
        output_interval=STEP,
        start_values=forces(fmu),
        output=names,
    )
    found = np.array([result[n][-1] for n in names])
    # FMPy adds up its times, so the last bits of the step sizes differ; a step amplifies that by no more than
    # the friction and the gains of the controller, which is little in 0.2 s
    assert found == pytest.approx(ours(fmu), rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("fmu", each("filter", "three-link", "six-link", "sampled"), indirect=True)
def test_fmpy_integrates_it_with_cvode(fmu):
    from fmpy import simulate_fmu

    states = [n for n in fmu.dae.states if n in fmu.references]
    result = simulate_fmu(
        str(fmu.path),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=STEPS * STEP,
        relative_tolerance=1e-8,
        output_interval=STEP * STEPS / 4,
        start_values=forces(fmu),
        output=states,
    )
    truth = simulate(fmu.dae, stop=STEPS * STEP, inputs=forces(fmu), tolerance=1e-10)
    for state in states:
        # a hundred times the tolerance of CVode's steps
        assert result[state][-1] == pytest.approx(
            truth[state][-1], abs=1e-6 * (1 + np.abs(truth[state]).max())
        )


def test_fmuloader_steps_it_to_the_same_bits(fmu):
    loader = pytest.importorskip(f"fmuloader.fmi{fmu.version}")
    references = [fmu.references[n] for n in shown(fmu)]
    inputs = {fmu.references[n]: value for n, value in forces(fmu).items()}
    identifier = fmu.described.coSimulation.modelIdentifier
    if fmu.version == 2:
        slave = loader.Fmi2Slave(fmu.folder, model_identifier=identifier)
        slave.instantiate("here", loader.Fmi2Type.CO_SIMULATION, guid=fmu.described.guid)
        slave.setup_experiment()
        get, put = slave.get_real, slave.set_real
    else:
        slave = loader.Fmi3Slave(fmu.folder, model_identifier=identifier)
        slave.instantiate_co_simulation("here", instantiation_token=fmu.described.instantiationToken)
        get, put = slave.get_float64, slave.set_float64
    slave.enter_initialization_mode()
    put(list(inputs), list(inputs.values()))
    slave.exit_initialization_mode()
    for k in range(STEPS):
        slave.do_step(k * STEP, STEP)
    assert np.array_equal(get(references), ours(fmu))
    slave.terminate()
    slave.free_instance()


def test_ecos_steps_it_to_the_same_numbers(fmu):
    try:
        library = Path(sys.prefix) / "lib" / "libtbb.so.12"  # where the package tbb puts what ecospy needs
        if library.exists():
            ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
        ecos = import_module("ecospy")
    except (ImportError, OSError) as error:  # its library needs Debian's libtbb12
        pytest.skip(f"ecospy: {error}")
    structure = ecos.EcosSimulationStructure()
    structure.add_model("here", str(fmu.path))
    structure.add_parameter_set("start", {f"here::{n}": v for n, v in forces(fmu).items()})
    with ecos.EcosSimulation(structure=structure, step_size=STEP) as simulation:
        simulation.init(parameter_set="start")
        simulation.step(STEPS)
        found = [simulation.get_real(f"here::{n}") for n in shown(fmu)]
        simulation.terminate()
    assert found == pytest.approx(ours(fmu), rel=1e-8, abs=1e-8)  # its times are added up, too


def test_libcosim_steps_it_to_the_same_numbers(fmu):
    executions = pytest.importorskip("libcosimpy.CosimExecution")
    observers = pytest.importorskip("libcosimpy.CosimObserver")
    slaves = pytest.importorskip("libcosimpy.CosimSlave")
    if fmu.version == 3:
        pytest.skip("libcosim runs FMI 2")
    execution = executions.CosimExecution.from_step_size(step_size=round(STEP * 1e9))  # ns
    observer = observers.CosimObserver.create_last_value()
    execution.add_observer(observer)
    slave = execution.add_local_slave(slaves.CosimLocalSlave(fmu_path=str(fmu.path), instance_name="here"))
    for n, value in forces(fmu).items():
        execution.real_initial_value(slave, fmu.references[n], value)
    execution.step(step_count=STEPS)
    found = observer.last_real_values(slave, [fmu.references[n] for n in shown(fmu)])
    assert list(found) == pytest.approx(ours(fmu), rel=1e-8, abs=1e-8)  # times in whole nanoseconds


@pytest.mark.parametrize("fmu", each("pendulum", "filter", "three-link", "six-link"), indirect=True)
def test_casadi_reads_back_the_equations(fmu):
    import casadi as ca

    builder = ca.DaeBuilder("read", str(fmu.folder))
    assert list(builder.x())[:1] == list(fmu.dae.states)[:1]
    assert list(builder.u()) == list(fmu.dae.inputs)
    rates = builder.create("rates", ["x", "u"], ["ode"])
    slopes = rates.jacobian()
    truth = Numbers(fmu.dae)
    random, states = np.random.default_rng(5), len(truth.x)
    for _ in range(3):
        x = truth.x + 0.02 * random.standard_normal(states)
        u = random.uniform(-60, 60, len(truth.u))
        wanted, jacobian = truth(0.0, x, u), truth.jacobian(0.0, x, u)
        found = rates(x, u)
        size = np.abs(wanted).max()
        assert np.array(found).ravel() == pytest.approx(wanted, abs=1e-13 * size)
        # for the six-link robot a change of the states by rounding alone moves the Jacobian by 1.5e-12 of its size
        bound = (1e-11 if truth.z.size else 1e-13) * np.abs(jacobian).max()
        by_x, by_u = (np.array(ca.densify(e)) for e in slopes(x, u, found))
        assert by_x == pytest.approx(jacobian[:, 1 : 1 + states], abs=bound)
        assert by_u == pytest.approx(jacobian[:, 1 + states : 1 + states + len(u)], abs=bound)


@pytest.mark.parametrize("fmu", each("three-link"), indirect=True)
def test_casadi_knows_the_slopes_by_parameters(fmu):
    import casadi as ca

    builder = ca.DaeBuilder("read", str(fmu.folder))
    parameters = list(builder.p())
    rates = builder.create("rates", ["x", "u", "p"], ["ode"])
    truth = Numbers(fmu.dae)
    p = np.array([fmu.dae.table.values[n] for n in parameters])
    order = [list(fmu.dae.system().parameters).index(n) for n in parameters]
    slopes = truth.jacobian(0.0, truth.x, truth.u)[:, 1 + truth.x.size + truth.u.size :][:, order]
    found = np.array(ca.densify(rates.jacobian()(truth.x, truth.u, p, 0)[2]))
    assert np.abs(slopes).max() > 1  # masses and friction act at the start
    assert found == pytest.approx(slopes, abs=1e-12 * np.abs(slopes).max())
