package Motions "models of one class each"
  constant Real g(unit = "m/s2") = 9.81;
  type Side = enumeration(left "minus x", right "plus x");

  model Pendulum "in Cartesian coordinates"
    import Motions.Side.right;
    parameter Real L(unit = "m", min = 0) = 0.5, m(unit = "kg") = 1;
    parameter Side side = right;
    parameter Real x0(unit = "m") = if side == Side.right then 0.3 else -0.3;
    Real r[2](unit = {"m", "m"}, start = {x0, -0.4});
    Real v[2](each unit = "m/s", start = {0, 0});
    Real f(unit = "N/m") "force of the rod for a length";
  initial equation
    r[1] = x0;
    v[1] = 0;
  equation
    v = der(r);
    m * der(v) = {0, -m * g} - f * r;
    r * r = L ^ 2;
    annotation(experiment(StopTime = 2));
  end Pendulum;

  model Ball "bounces, and is counted"
    parameter Real e = 0.8;
    Real h(unit = "m", start = 1, fixed = true);
    Real v(unit = "m/s", start = 0, fixed = true);
    discrete Integer n(start = 0);
  equation
    der(h) = v;
    der(v) = -g;
    when h <= 0 then
      reinit(v, -e * pre(v));
      n = pre(n) + 1;
    elsewhen n > 20 then
      n = 0;
    end when;
    when n >= 6 then
      terminate("enough");
    end when;
    annotation(experiment(StopTime = 4));
  end Ball;

  model Sampled "a lag that a sampled integrator controls"
    parameter Real T = 0.1;
    parameter Boolean locked = false;
    Real x(start = 0, fixed = true);
    discrete Real u(start = 0);
  equation
    der(x) = u - x;
    when sample(0, T) then
      u = pre(u) + 0.2 * (1 - x);
    end when;
    assert(x < 5, "x runs away");
    assert(T > 0, "expected a positive T");
    if locked then
      assert(false, "it is locked");
    end if;
  end Sampled;

  model Thermostat "a switch with hysteresis"
    parameter Real low = 0.4, high = 0.6;
    Boolean on;
    Real T(start = 0.5, fixed = true);
  initial equation
    pre(on) = true;
  equation
    on = pre(on) and T < high or T < low;
    der(T) = if on then 1 else -1;
  end Thermostat;
end Motions;
