# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A robot joint from Modelica and Optimica text
#
# A motor turns an arm through an elastic gear. The joint is written in Modelica, its motion in minimum time in Optimica, as
# for JModelica.org. Both are read as they stand; the one class is simulated, linearised, optimised, refined and exported as
# an FMU.

# %%
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from gantrytau import linearize, load_modelica, simulate
from gantrytau_fmu import export_fmu, run_fmu
from gantrytau_optimica import load_optimica, optimize

folder = Path(mkdtemp(prefix="joint-"))

# %% [markdown]
# ## The joint, in Modelica

# %%
(folder / "Joint.mo").write_text("""
package Joint "a joint of a robot with an elastic gear"
  connector Flange
    Real phi(unit = "rad");
    flow Real tau(unit = "N.m");
  end Flange;
  model Inertia
    Flange a, b;
    parameter Real J(unit = "kg.m2", min = 0);
    Real phi(unit = "rad", start = 0, fixed = true), w(unit = "rad/s", start = 0, fixed = true);
  equation
    phi = a.phi; phi = b.phi; w = der(phi);
    J * der(w) = a.tau + b.tau;
  end Inertia;
  model Gear "ideal, ratio turns of a for one of b"
    Flange a, b;
    parameter Real ratio = 1;
  equation
    a.phi = ratio * b.phi;
    0 = ratio * a.tau + b.tau;
  end Gear;
  model SpringDamper
    Flange a, b;
    parameter Real c(unit = "N.m/rad"), d(unit = "N.m.s/rad");
    Real bend(unit = "rad") = b.phi - a.phi, tau(unit = "N.m") = c * bend + d * der(bend);
  equation
    b.tau = tau; a.tau = -tau;
  end SpringDamper;
  model Torque
    Flange b;
    input Real tau(unit = "N.m");
  equation
    b.tau = -tau;
  end Torque;
  model Gravity "of an arm that hangs at phi = 0"
    Flange a;
    parameter Real m(unit = "kg") = 20, l(unit = "m") = 0.5;
  equation
    a.tau = m * 9.81 * l * sin(a.phi);
  end Gravity;
  model Arm "motor, gear and arm; the torque of the motor is open"
    parameter Real stiffness(unit = "N.m/rad") = 2e4;
    input Real torque(unit = "N.m") "of the motor";
    Torque drive(tau = torque);
    Inertia motor(J = 1e-3), arm(J = 6);
    Gear gear(ratio = 100);
    SpringDamper elastic(c = stiffness, d = 20);
    Gravity gravity;
  equation
    connect(drive.b, motor.a);
    connect(motor.b, gear.a);
    connect(gear.b, elastic.a);
    connect(elastic.b, arm.a);
    connect(arm.b, gravity.a);
    annotation(experiment(StopTime = 2));
  end Arm;
end Joint;
""")
Arm = load_modelica(folder / "Joint.mo")["Joint.Arm"]
print(Arm.__doc__)

# %% [markdown]
# ## Simulated and linearised
#
# Held at 45 degrees by the torque that balances gravity, the motor swings against the arm. Two inertias on a spring have
# $\omega^2 = c\,(1/J_1 + 1/J_2)$, with the motor's inertia times the ratio squared.

# %%
AT = {"arm.phi": np.pi / 4}
hold = 20 * 9.81 * 0.5 * np.sin(np.pi / 4) / 100  # N.m, at the motor
linear = linearize(Arm, inputs=["torque"], outputs=["arm.phi"], at=AT | {"torque": hold})
fastest = np.abs(linear.poles).max()
print(linear.poles.round(2), fastest)
assert abs(fastest / np.sqrt(2e4 * (1 / 10 + 1 / 6)) - 1) < 0.02

# %%
swing = simulate(Arm, inputs={"torque": 0.5})
assert swing.time[-1] == 2.0  # the experiment of the text
swing.plot("arm.phi", "elastic.bend")

# %% [markdown]
# ## Its fastest motion, in Optimica
#
# The problem has the model as a component. The arm is lifted by 90 degrees from rest to rest; the torque of the motor is
# limited.

# %%
(folder / "Lift.mop").write_text("""
optimization Lift(objective = finalTime, finalTime(free = true, min = 0.1, max = 3, initialGuess = 1))
  parameter Real limit(unit = "N.m") = 4;
  Joint.Arm robot;
  input Real torque(unit = "N.m", min = -limit, max = limit) = robot.torque;
constraint
  robot.arm.phi(finalTime) = 1.5707963267949;
  robot.arm.w(finalTime) = 0;
  robot.elastic.bend(finalTime) = -20 * 9.81 * 0.5 / robot.stiffness "at rest under gravity";
  robot.elastic.bend(startTime) = 0;
  robot.motor.w(finalTime) = 0;
end Lift;
""")
Lift = load_optimica(folder / "Lift.mop", folder)["Lift"]
fastest = optimize(Lift, refine=1e-6)
print(fastest.report())
assert fastest.refinement.reached

# %% [markdown]
# The torque stays at its limits and changes sides three times, so that the swinging of the gear ends with the motion.

# %%
print([round(fastest.final_time * switch.share, 4) for switch in fastest.refinement.switches])
assert len(fastest.refinement.switches) == 3
fastest.plot("torque", "robot.motor.w", "robot.elastic.bend")

# %% [markdown]
# ## The same joint as an FMU
#
# The FMU of the joint is driven by the optimal torque, held for 0.1 ms at a time, as a controller would.

# %%
file = export_fmu(Arm, folder / "joint.fmu")
torque = {"torque": fastest.signal("torque")}  # a function of time
run = run_fmu(file, stop=fastest.final_time, step=1e-4, inputs=torque, tolerance=1e-8)
print(run.final("arm.phi"), run.final("arm.w"))
assert abs(run.final("arm.phi") - np.pi / 2) < 1e-3
assert abs(run.final("arm.w")) < 5e-3
