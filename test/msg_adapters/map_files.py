"""A small table and its import map."""

CSV = "t,phi,i,load\n0.0,90,1500,2\n0.5,-45,-500,4\n1.0,0,0,6\n"
MAP = """
time: {column: t, unit: s}
channels:
  position: {column: phi, unit: deg, sign: -1}
  command: [{column: i, unit: mA, scale: 6.8}, {column: load, unit: N m, constant: 0.5}]
"""
