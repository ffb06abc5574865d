//! base 3.6.0
package 'A.B'
  type 'Angle' = Real(unit = "rad");
  record 'A.R'
    Real 'p';
    Real[2] 'q';
  end 'A.R';
  constant Real 'A.c' = 2.0;
  pure constant function 'A.f' "doubles"
    input Real 'x';
    output Real 'y';
  algorithm
    'y' := 2*'x';
  end 'A.f';
  @3 model 'A.B' "all kinds"
    'A.R' 'r';
    parameter equation guess('r'.'p') = 1.5;
    'Angle' 'x[1]';
    parameter equation guess('x[1]') = prioritize('A.c', 3) "from text";
    Real[3] 'z'(start = {1, 2, 3});
    parameter Real 'k' = 0.5;
    discrete Real 'n'(start = 4, fixed = true);
  initial equation
    'x[1]' = guess('x[1]');
    prioritize('z', 1);
    'z' = guess('z');
  equation
    @1 der('x[1]') @2 = -'k'*'A.f'('x[1]') @7;
    der('z') = fill('x[1]', 3);
    'r'.'p' = 'x[1]' + 1;
    'r'.'q' = {'r'.'p', time};
    when 'x[1]' < 1 then
      'n' = pre('n') + 1;
    end when;
  end 'A.B';
end 'A.B';
