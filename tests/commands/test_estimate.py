"""`gantrytau estimate`: files of estimations, what is printed and written, what cannot be told apart, what is refused."""

import numpy as np
import pytest

from gantrytau import simulate
from gantrytau.commands.estimate.estimate_file import EXAMPLE
from gantrytau_models import Pendulum

FAULT, MISUSE = 1, 2
CART = """\
from gantrytau import Input, Model, Parameter, Real, der

class Cart(Model):
    m = Parameter(1.0, unit="kg", min=0.0)
    gain = Parameter(1.0, unit="N")
    d = Parameter(0.0, unit="kg/s")
    x = Real(unit="m", start=0.0, fixed=True)
    v = Real(unit="m/s", start=0.0, fixed=True)
    u = Input(unit="1", start=0.0)

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.gain * self.u - self.d * self.v
"""


@pytest.fixture
def cart(tmp_path):
    """Writes a file for a cart whose data are those of 2 kg that are pushed by 3 N for 2 s; says where it is."""
    times = np.linspace(0.0, 2.0, 21)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, times.size)
    rows = zip(times, 0.75 * times**2 + noise, np.full(times.size, 3.0), strict=True)
    (tmp_path / "robot.py").write_text(CART)
    text = "time [ms];x [mm];u\n" + "\n".join(f"{1e3 * t};{1e3 * x};{u}" for t, x, u in rows)
    (tmp_path / "push.csv").write_text(text.replace(".", ","))  # as a spreadsheet in Germany writes it

    def write(text, head='model = "robot.py:Cart"\n'):
        file = tmp_path / "cart.toml"
        file.write_text(head + text)
        return str(file)

    return write


PUSH = '[[experiment]]\ndata = "push.csv"\n'


def test_the_mass_of_a_pushed_cart_and_its_deviation(answer, cart):
    found = answer("estimate", cart(f"[estimate]\nm = 1.5\n{PUSH}deviation = 0.001\n"))
    # x = 3 t^2 / (2 m): linear in 1/m, whose deviation is that of the line through the origin
    times = np.linspace(0.0, 2.0, 21)
    expected = 1e-3 / np.sqrt(np.sum((1.5 * times**2) ** 2)) * 4.0
    m = found["parameters"]["m"]
    assert m["deviation"] == pytest.approx(expected, rel=1e-2)
    assert abs(m["value"] - 2.0) < 4 * expected
    assert found["covariance"] == [[pytest.approx(expected**2, rel=2e-2)]]
    assert found["set"] == {"m": m["value"]}


def test_what_cannot_be_told_apart_is_named(fails, cart):
    said = fails(FAULT, "estimate", cart(f"[estimate]\nm = 1.5\ngain = 1.0\n{PUSH}"))
    assert "m" in said
    assert "gain" in said
    assert "Take one of each as known, or add measured variables or experiments" in said
    said = fails(FAULT, "estimate", cart(f"[estimate]\nm = 1.5\nd = 0.1\n[set]\nm = 2.0\n{PUSH}"))
    assert "every experiment has its own m" in said


def test_the_example_runs_and_its_values_go_into_other_commands(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "swing.toml").write_text(run("estimate", "--example").stdout)
    command = EXAMPLE.split("from a simulation: ")[1].split("model =")[0].replace("\\\n#", "").split()
    assert run(*command[1:]).exit_code == 0
    spoken = run("estimate", "swing.toml", "--output", "found.toml", "--plot", "fit.png")
    assert spoken.exit_code == 0, spoken.output
    assert "As options: --set L=0.9" in spoken.stdout
    assert "covariance:" in spoken.stdout
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")
    assert (
        (tmp_path / "found.toml")
        .read_text()
        .startswith("# Parameters of Pendulum\n# estimated from 121 values")
    )
    again = ("simulate", "Pendulum", "--stop", "2", "--set", "found.toml", "--points", "3")
    kept = run(*again, "--set", "x.start=0.5", "--set", "y.start=-0.748", "--output", "again.csv")
    assert kept.exit_code == 0, kept.output
    truth = simulate(Pendulum(L=0.9, damping=0.15), starts={"x": 0.5, "y": -0.748}, stop=2.0)
    row = (tmp_path / "again.csv").read_text().splitlines()
    last = dict(zip(row[0].split(","), row[-1].split(","), strict=True))
    assert float(last["x [m]"]) == pytest.approx(truth.final("x"), abs=1e-4)  # a tenth of the deviation told


def test_the_models_own_value_is_a_guess_and_columns_have_other_names(answer, cart):
    text = (
        '[estimate]\nm = {}\n[[experiment]]\ndata = "push.csv"\nmeasured = { x = "x" }\nstart = { v = 0.0 }\n'
    )
    assert answer("estimate", cart(text))["parameters"]["m"]["value"] == pytest.approx(2.0, rel=1e-2)
    held = '[estimate]\nm = { guess = 1.2, min = 0.5 }\n[[experiment]]\ndata = "push.csv"\nheld = ["u"]\nstop = 1.0\n'
    assert answer("estimate", cart(held))["parameters"]["m"]["value"] == pytest.approx(2.0, rel=1e-2)


def test_each_experiment_may_have_its_own(answer, cart):
    text = f"[estimate]\nm = 1.5\n{PUSH}name = 'first'\nstart = {{ x = {{ guess = 0.0 }} }}\n{PUSH}name = 'second'\n"
    found = answer("estimate", cart(text))
    assert found["set"].keys() == {"m"}
    assert found["own"] == ["first.start(x)"]
    assert any("hold the same values" in words for words in found["warnings"])


REFUSED = {
    'modle = "a"\n': "modle: there is no such key; did you mean 'model'?",
    "[estimate]\nm = 1.0\n": "experiment: found nothing, expected",
    f"[estimate]\nmm = 1.0\n{PUSH}": "estimate.mm: the model has no 'mm'; did you mean 'm'?",
    f"[estimate]\nm = 1.0\n{PUSH}dat = 1\n": "experiment[0].dat: there is no such key; did you mean 'data'?",
    f"[estimate]\nm = 1.0\n{PUSH}deviation = {{ y = 1 }}\n": "deviation.y: there is no such key",
    f"[estimate]\nm = 1.0\n{PUSH}begin = 3.0\n": "found no data between begin and stop, expected some; widen them",
    f'loss = "huber"\n[estimate]\nm = 1.0\n{PUSH}': "huber",
}


@pytest.mark.parametrize("text", REFUSED)
def test_wrong_files_are_refused_in_words(run, cart, text):
    spoken = run("estimate", cart(text))
    assert spoken.exit_code in (FAULT, MISUSE), spoken.output
    assert REFUSED[text] in spoken.stderr
    assert "Traceback" not in spoken.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,x [kg]\n0,1\n", "column x: found 'kg', a mass, expected a length in m"),
        ("time,y\n0,1\n1,2\n", "found no column of push.csv that is a variable of the model (y)"),
        ("time,x\n0,1\n1,2\n2,3\n", "the input u of experiment_1 is not known"),
    ],
)
def test_bad_data_are_told_with_their_place(run, cart, tmp_path, text, words):
    file = cart(f"[estimate]\nm = 1.0\n{PUSH}")
    (tmp_path / "push.csv").write_text(text)
    spoken = run("estimate", file)
    assert spoken.exit_code in (FAULT, MISUSE), spoken.output
    assert words in spoken.stderr


def test_places_are_told_before_the_work(fails, cart):
    file = cart(f"[estimate]\nm = 1.0\n{PUSH}")
    assert "--output a.csv: found the suffix '.csv'" in fails(MISUSE, "estimate", file, "--output", "a.csv")
    assert "there is no such file" in fails(MISUSE, "estimate", "no.toml")
