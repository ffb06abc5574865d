package Drive "a small library with the models that use it"
  package Units
    type Angle = Real(unit = "rad", displayUnit = "deg");
    type Speed = Real(unit = "rad/s");
    type Torque = Real(unit = "N.m");
    type Voltage = Real(unit = "V");
    type Current = Real(unit = "A");
    type Length = Real(unit = "m");
  end Units;

  package Interfaces
    import Drive.Units.*;
    connector Pin "electrical pin"
      Voltage v "potential";
      flow Current i "current into the component";
    end Pin;
    connector Flange
      Units.Angle phi;
      flow Units.Torque tau;
    end Flange;
    connector Slide
      Units.Length s;
      flow Real f(unit = "N");
    end Slide;
    connector Signal = input Real;
    partial model TwoPins
      Pin p, n;
      Voltage v;
      Current i;
    equation
      v = p.v - n.v;
      0 = p.i + n.i;
      i = p.i;
    end TwoPins;
  end Interfaces;

  package Parts
    import I = Drive.Interfaces;
    import Drive.Interfaces.{TwoPins, Slide};
    model Resistor
      extends TwoPins;
      parameter Real R(unit = "Ohm", min = 0) = 1;
    equation
      v = R * i;
    end Resistor;
    model HeatingResistor
      extends Resistor;
      Real P(unit = "W") = v * i;
    end HeatingResistor;
    model Inductor
      extends TwoPins(i(fixed = true, start = 0));
      parameter Real L(unit = "H") = 1e-3;
    equation
      L * der(i) = v;
    end Inductor;
    model Capacitor
      extends TwoPins(v(fixed = true));
      parameter Real C(unit = "F");
    equation
      C * der(v) = i;
    end Capacitor;
    model Source
      extends TwoPins;
      parameter Real V(unit = "V") = 12;
    equation
      v = V;
    end Source;
    model Ground
      I.Pin p;
    equation
      p.v = 0;
    end Ground;
    model Emf
      extends TwoPins;
      parameter Real k(unit = "N.m/A") = 0.05;
      I.Flange flange;
      Drive.Units.Speed w;
    equation
      w = der(flange.phi);
      v = k * w;
      flange.tau = -k * i;
    end Emf;
    model Inertia
      I.Flange flange;
      parameter Real J(unit = "kg.m2") = 1e-4;
      Units.Angle phi(start = 0, fixed = true) = flange.phi;
      Units.Speed w(start = 0, fixed = true);
    equation
      w = der(phi);
      J * der(w) = flange.tau;
    end Inertia;
    model Mass
      Slide a, b;
      parameter Real m(unit = "kg") = 1;
      Units.Length s;
      Real v(unit = "m/s");
    equation
      a.s = s;
      b.s = s;
      v = der(s);
      m * der(v) = a.f + b.f;
    end Mass;
    model Spring
      Slide a, b;
      parameter Real c(unit = "N/m") = 100, d(unit = "N.s/m") = 0.1;
      Units.Length x = b.s - a.s;
    equation
      b.f = c * x + d * der(x);
      a.f + b.f = 0;
    end Spring;
    model Wall
      Slide a;
    equation
      a.s = 0;
    end Wall;
  end Parts;

  model Motor "DC motor with permanent magnets"
    import Drive.Parts.*;
    parameter Real R(unit = "Ohm") = 2, L(unit = "H") = 1e-3, k(unit = "N.m/A") = 0.05;
    replaceable Resistor resistor(R = R) constrainedby Interfaces.TwoPins;
    Inductor inductor(L = L);
    Emf emf(k = k);
    Inertia rotor(J = 2e-4);
    Source source;
    Ground ground;
  equation
    connect(source.p, resistor.p);
    connect(resistor.n, inductor.p);
    connect(inductor.n, emf.p);
    connect(emf.n, source.n);
    connect(source.n, ground.p);
    connect(emf.flange, rotor.flange);
    annotation(experiment(StopTime = 0.5, Tolerance = 1e-8));
  end Motor;

  model WarmMotor
    extends Motor(redeclare Parts.HeatingResistor resistor(R = 3), source(V = 24));
  end WarmMotor;

  model Choked "with another inductor in place of the resistor"
    extends Motor(redeclare Parts.Inductor resistor(L = 1e-2));
  end Choked;

  model Rc
    parameter Real C(unit = "F") = 1e-3;
    Parts.Source source(V = 10);
    Parts.Resistor r(R = 100);
    Parts.Capacitor c(final C = C, v.start = 2);
    Parts.Ground ground;
  equation
    connect(source.p, r.p);
    connect(r.n, c.p);
    connect(c.n, source.n);
    connect(source.n, ground.p);
  end Rc;

  model Chain "masses between springs, from a wall"
    parameter Integer n(min = 1) = 3;
    parameter Boolean walled = true;
    Parts.Mass mass[n](m = {k for k in 1:n}, s(each fixed = true, start = fill(0.1, n)), each v(start = 0, fixed = true));
    Parts.Spring spring[n](each c = 50);
    Parts.Wall wall if walled;
    Real energy(unit = "J") = sum(mass.m .* mass.v .^ 2) / 2;
  equation
    connect(spring[1].a, wall.a);
    connect(spring.b, mass.a);
    for k in 2:n loop
      connect(mass[k - 1].b, spring[k].a);
    end for;
    annotation(experiment(StopTime = 2));
  end Chain;
end Drive;
