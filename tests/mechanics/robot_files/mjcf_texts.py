"""Robots in MJCF, written for tests: what each shows stands in its name."""

BAR = '<geom type="capsule" fromto="0 0 0 {0} 0 0" size="0.03" density="800"/>'


def bar(name: str, length: float, joints: str, inside: str = "", where: str = "0 0 0") -> str:
    """A bar along x with its joints."""
    return f'<body name="{name}" pos="{where}">{joints}{BAR.format(length)}{inside}</body>'


def hinge(name: str, more: str = "") -> str:
    return f'<joint name="{name}" axis="0 -1 0" {more}/>'


def four_bar(equality: str) -> str:
    """Crank 0.3 m, coupler 0.9 m and rocker 0.6 m on a ground of 1 m, each along x where all coordinates are `ref`."""
    coupler = bar("coupler", 0.9, hinge("crank_pin"), where="0.3 0 0")
    crank = f'<body name="crank" euler="0 -60 0">{hinge("crank_pivot")}{BAR.format(0.3)}{coupler}</body>'
    rocker = (
        f'<body name="rocker" pos="1 0 0" euler="0 -85 0">{hinge("rocker_pivot")}{BAR.format(0.6)}</body>'
    )
    return f"<worldbody>{crank}{rocker}</worldbody><equality>{equality}</equality>"


SERIAL = """<compiler angle="degree" eulerseq="XYZ"/><option gravity="0 1 -9.81"/>
<default><geom density="500"/><joint damping="0.1"/>
  <default class="soft"><joint stiffness="3" springref="20" armature="0.02"/></default></default>
<worldbody><body name="one" pos="0 0 1" euler="10 20 30">
  <joint name="a" axis="0 1 1" pos="0.1 0 0.05" ref="15"/>
  <joint name="b" class="soft" type="slide" axis="1 0 0.3" ref="0.2"/>
  <geom type="capsule" fromto="0 0 0 0.3 0.1 0.2" size="0.04"/>
  <geom type="box" size=".1 .05 .02" pos="0 .1 0" quat="1 2 0 .3"/>
  <body name="two" pos="0.3 0.1 0.2" xyaxes="0 1 0 -1 0.2 0.4">
    <joint name="c" class="soft" range="-90 90"/><geom type="cylinder" size="0.03 0.2" mass="1.5"/>
    <site name="tip" pos="0 0 .2" axisangle="0 1 0 40"/>
    <body name="three" pos="0 .2 0" zaxis="0 0 -1"><joint name="d" type="slide" axis="0 0 1"/>
      <inertial pos="0.01 0.02 0.1" quat="1 .2 .3 .4" mass="0.7" diaginertia="0.01 0.02 0.025"/></body>
  </body></body></worldbody>"""
TREE = f"""<worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"/><geom type="box" size=".2 .1 .05"/>
  {bar("left", 0.5, hinge("swing", 'armature="0.05"'))}
  {bar("right", 0.4, '<joint name="turn" axis="0 0 1"/>', bar("hand", 0.2, hinge("wrist"), where="0.4 0 0"))}
  </body></worldbody>"""
SLIDERS = f"""<worldbody><body name="x"><joint name="x" type="slide" axis="1 0 0"/><geom size=".1"/>
  <body name="y"><joint name="y" type="slide" axis="0.3 1 0"/><geom type="ellipsoid" size=".1 .2 .15"/>
  {bar("z", 0.3, '<joint name="z" type="slide" axis="0 0 2" stiffness="50" damping="3"/>')}</body></body></worldbody>"""
BALL = """<worldbody><body name="bob" pos="0 0 1"><joint name="ball" type="ball"/>
  <inertial pos="0.3 0.1 -0.4" mass="2" fullinertia="0.1 0.08 0.09 0.01 0.02 -0.01"/></body></worldbody>"""
FREE = f"""<worldbody><body name="base" pos="0 0 1" quat="1 .5 .2 -.3"><freejoint/><geom type="box" size=".2 .1 .3"/>
  {bar("arm", 0.5, hinge("elbow"))}</body></worldbody>"""
ASKEW = '<joint name="q" axis="1 0 1" pos=".1 0 0"/>'
TREES = {
    "serial": SERIAL,
    "tree": TREE,
    "sliders": SLIDERS,
    "two joints of one body": f"<worldbody>{bar('b', 0.5, hinge('p') + ASKEW)}</worldbody>",
    "upright": f'<worldbody><body name="b" euler="0 90 0">{hinge("p")}{BAR.format(0.4)}'
    f'<body name="c" quat="0 1 0 0">{hinge("q")}{BAR.format(0.3)}</body></body></worldbody>',
}
SLIDER_CRANK = f"""<worldbody>{bar("crank", 0.2, hinge("turn"), bar("rod", 0.5, hinge("pin"), where="0.2 0 0"))}
  <body name="piston" pos="0.7 0 0"><joint name="way" type="slide" axis="1 0 0.5"/><geom size=".05"/></body>
  </worldbody><equality><connect body1="rod" body2="piston" anchor="0.5 0 0"/></equality>"""
GEARED = f"""<worldbody>{bar("one", 0.5, hinge("p", 'ref="10"'))}{bar("two", 0.4, hinge("q"), where="0 1 0")}
  {bar("three", 0.3, hinge("r"), where="0 2 0")}
  <body name="rack"><joint name="s" type="slide" axis="1 0 1"/><geom size=".1"/></body>
  </worldbody><equality><joint joint1="q" joint2="p" polycoef="0.1"/>
  <joint joint1="s" joint2="p" polycoef="0 0.2"/>
  <joint joint1="r" polycoef="0.3 0 0 0 0"/></equality>"""
WELDED = f"""<worldbody><body name="a" euler="0 110 0">{hinge("p")}{BAR.format(0.4)}
  <body name="top" pos="0.4 0 0" euler="0 -110 0">{hinge("q")}{BAR.format(0.5)}</body></body>
  <body name="b" pos="1 0 0" euler="0 110 0">{hinge("u")}{BAR.format(0.4)}
  <body name="other" pos="0.4 0 0" euler="0 -110 0">{hinge("v")}{BAR.format(-0.5)}</body></body>
  </worldbody><equality><weld body1="top" body2="other"/></equality>"""
LOOPS = {
    "four-bar by its default pose": four_bar('<connect body1="coupler" body2="rocker" anchor="0.9 0 0"/>'),
    "slider crank": SLIDER_CRANK,
    "gears and a lock": GEARED,
    "weld": WELDED,
}
