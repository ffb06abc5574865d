package Functions "functions, records, and what is replaced"
  record Gains "of a controller"
    Real k = 2;
    Real limits[2] = {-1, 1};
  end Gains;

  function clamp "x between two limits, and whether it was beyond"
    input Real x;
    input Real limits[2] = {-10, 10};
    output Real y;
    output Boolean beyond;
  algorithm
    beyond := x < limits[1] or x > limits[2];
    if x < limits[1] then
      y := limits[1];
    elseif x > limits[2] then
      y := limits[2];
    else
      y := x;
    end if;
  end clamp;

  function polynomial
    input Real x;
    input Real c[:];
    output Real y = 0;
  algorithm
    for k in size(c, 1):-1:1 loop
      y := y * x + c[k];
    end for;
  end polynomial;

  function root "by Newton's method, of a number"
    input Real a;
    output Real y;
  protected
    Real old = a + 1;
  algorithm
    y := a;
    while abs(y - old) > 1e-14 loop
      old := y;
      y := (y + a / y) / 2;
      if y < 0 then
        break;
      end if;
    end while;
  end root;

  function scaled
    input Gains g;
    input Real factor;
    output Gains result;
  protected
    Real table[2, 2];
  algorithm
    table[1, :] := g.limits;
    table[2, :] := factor * table[1, :];
    result := g;
    result.limits := table[2, :];
    result.k := g.k * factor;
  end scaled;

  partial model Law
    input Real e;
    output Real u;
  end Law;

  model Proportional
    extends Law;
    parameter Gains g;
  equation
    u = clamp(g.k * e, g.limits);
  end Proportional;

  model Quadratic
    extends Law;
    parameter Real a = 1;
  equation
    u = a * e ^ 2;
  end Quadratic;

  model Surroundings
    parameter Real wind = 0;
  end Surroundings;

  model Controlled
    replaceable model Controller = Proportional constrainedby Law;
    Controller controller(e = 1 - x);
    outer Surroundings around;
    Real x(start = 0, fixed = true);
    Real y;
    Boolean low = x < 0.5;
  equation
    der(x) = controller.u + around.wind;
  algorithm
    y := polynomial(x, {1, 2, 3});
    if low then
      y := -y;
    end if;
  end Controlled;

  model Whole
    inner Surroundings around(wind = 0.1);
    parameter Gains g = scaled(Gains(k = 3), 0.5);
    Controlled plain(controller(g = g));
    Controlled other(redeclare model Controller = Quadratic(a = 2));
    final constant Real two = root(4);
    Real z[3] = polynomial({1, 2, 3} * time, {two, 1}) + {max(k, 2) for k in 1:3};
    Boolean beyond;
    Real w;
  equation
    (w, beyond) = clamp(20 * time);
    annotation(experiment(StopTime = 1));
  end Whole;
end Functions;
