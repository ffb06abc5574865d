within Own.Examples;
// every construct of the grammar of Modelica 3.6 at least once
final encapsulated package Constructs "All" + " constructs"
  import SI = Modelica.Units.SI;
  import Modelica.Constants.*;
  import Modelica.Math.{sin, cos} "two of them";
  import Modelica.Blocks annotation(x = 1);

  type Angle = Real(final quantity = "Angle", unit = "rad", displayUnit = "deg") "angle";
  type Vector = Real[3](each start = 0.);
  type Level = enumeration(low "below" annotation(a = 1), high) "levels";
  type Any = enumeration(:);
  operator record Pair "two numbers"
    Real a, b;
    encapsulated operator '+'
      import Own.Pair;
      function add
        input Pair l;
        input Pair r;
        output Pair s = Pair(l.a + r.a, l.b + r.b);
      algorithm
      end add;
    end '+';
    operator function '-' = subtract;
  end Pair;
  connector Pin
    Real v;
    flow Real i;
    stream Real h;
  end Pin;
  connector In = input Real annotation(Icon(graphics = {Line(points = {{-1, 0}, {1.5e-3, +2E2}})}));
  expandable connector Bus
  end Bus;
  pure function f "a function"
    input Real x[:, size(x, 1)];
    input Integer n = 2 "how many";
    output Real y;
    output Boolean 'is it \'so\'?';
  protected
    Real z[n] := fill(0, n);
    parameter Integer k(min = 1) = 3;
  algorithm
    y := .Modelica.Math.sum({x[i, end] for i in 1:n}) ^ 2;
    (y, , z[1:2:end]) := g(x, n = n) "several";
    (y) := h(function q(a = 1), b = function .Q.q());
    for i in 1:n, j loop
      if i > 1 and not j == 2 or false then
        y := if i <= 2 then -y elseif i >= 5 then (y) else 1;
        break;
      elseif i <> 3 then
        return;
      else
      end if "unless";
    end for;
    while y < 1e3 loop
      y := y .* 2 ./ 3 .^ 2 .+ 1 .- 4;
    end while;
    when {sample(0, 1), initial()} then
      assert(true, "a \"quoted\" text
of two lines");
    elsewhen y > 1 then
      terminate("end");
    end when;
    annotation(derivative(noDerivative = n) = df, smoothOrder = 2);
  end f;
  impure function outside
    input Real x;
    output Real y;
    external "C" y = c_function(x, size(x, 1), "text") annotation(Library = "m");
    annotation(Inline = true);
  end outside;
  function plain
    external;
  end plain;
  function fortran
    external "FORTRAN 77" sub();
  end fortran;
  function df = der(f, x, n) "partial derivative";
  partial block Base
    parameter Real p[2, 2] = [1, 2; 3, 4];
    replaceable model Inner = Base constrainedby Base(p = identity(2)) "choose" annotation(choicesAllMatching = true);
    replaceable Pin pin[2](v(each start = 1, final fixed = true)) if p[1, 1] > 0 "pin" constrainedby Pin;
    inner outer World world;
  end Base;
  model Whole
    extends Base(
      p = 2 * [1, 2; 3, 4],
      redeclare final model Inner = Other(a = 1) "short",
      redeclare each replaceable Pin pin constrainedby Pin(h = 1),
      replaceable type T = Real[2],
      break connect(a, b[1].c),
      break gone,
      each final x.y(start = break) = {1, 2} "told") annotation(z = 1);
    redeclare model extends Inner(q = 1) "longer"
      Real extra;
    end Inner;
    redeclare replaceable function g = f(n = 1);
    discrete input Real u, w[3] = (a + b)[1:3] "wide" annotation(Dialog(group = "G"));
    constant output Boolean yes = true;
    Real x(start = 1), y = der(x) "derivative";
    Real empty[0] = zeros(0);
  public
    Real m = max(i ^ 2 for i in {1, 3, 7}), t = -2 ^ 2 + (-2) ^ 2 - (3 - (2 - 1)) / (4 / -2);
  initial equation
    pre(u) = 0;
  equation
    connect(a.p[1], b.n) annotation(Line(points = {{0, 0}, {1, 1}}));
    (x, y) = f(u, 2) "both";
    x + y = if time < 1 then 1 else 2;
    y = pure(outside(x)) - sum(w[:]);
    for i in 1:3 loop
      w[i] = i;
    end for;
    if initial() then
      x = 1;
    elseif noEvent(x > 1) then
      x = 2;
      y = 1:3 * 2;
    end if;
    when sample(0, 0.1) then
      reinit(x, -0.8 * pre(x));
    elsewhen x < 0 then
      u = 1;
    end when;
  initial algorithm
    u := 1;
  algorithm
    u := u + 1;
  protected
    Real last;
    annotation(experiment(StopTime = 1.0, Tolerance = 1e-6), Documentation(info = "<html>/* no comment */ // none</html>"));
  end Whole;
  class Odd /* the names optimization and constraint are ordinary here */
    Real optimization, constraint;
  end Odd;
  annotation(version = "1");
end Constructs;

package After
end After;
