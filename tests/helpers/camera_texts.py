"""Small camera files in the formats of the programs, for the tests of `dic.camera_files`."""

VIC3D = """<?xml version="1.0" encoding="ISO-8859-1"?>
<!DOCTYPE vpml>
<project dir="C:/test"><files lri="files"><calibrationimg>a.tif</calibrationimg></files>
<calibration lri="calibration">
 <camera id="0">955.05 645.23 6636.03 6636.44 -0.25 0.0125 0.875 -26.5
<orientation>179.93 9.416 -0.05775 -58.207 0.164 20.168</orientation></camera>
 <camera id="1">971.33 615.8 6609.85 6609.17 0.705 -0.005 1.0775 -30
<orientation>-179.94 -9.416 0.047 59.84375 0.2185 21.047</orientation></camera>
</calibration>
<polygonmask width="1920" height="1200" lri="polygonmask">
"""

MATCHID = "\n".join(
    [
        f"Cam{k}_{name};{value}"
        for k in (0, 1)
        for name, value in (
            ("Fx [pixels]", 2898.5 + k), ("Fy [pixels]", 2899.5), ("Fs [pixels]", 0.5), ("Kappa 1", -0.1),
            ("Kappa 2", 0.2), ("Kappa 3", 0), ("P1", 1e-3), ("P2", -2e-3), ("Cx [pixels]", 640),
            ("Cy [pixels]", 511.5),
        )
    ]
    + ["Tx [mm]; -180.5", "Ty [mm];1.5", "Tz [mm];48.25", "Theta [deg];0.5", "Phi [deg];15", "Psi [deg];-1"]
)  # fmt: skip

DICE = """<ParameterList>
  <Parameter name="xml_file_format" type="string" value="DICe_xml_camera_system_file"/>
  <Parameter name="system_type_3D" type="string" value="{kind}" />
  <Parameter name="extrinsics_relative_camera_to_camera" type="bool" value="{relative}" />
  <ParameterList name="CAMERA 0">
    <Parameter name="CX" type="double" value="638.9" /> <Parameter name="CY" type="double" value="407.3" />
    <Parameter name="FX" type="double" value="2468.5" /> <Parameter name="FY" type="double" value="2468.25" />
    <Parameter name="K1" type="double" value="0.064" />
    <Parameter name="LENS_DISTORTION_MODEL" type="string" value="{model}" />
    <Parameter name="ALPHA" type="double" value="179.965" />
    <Parameter name="BETA" type="double" value="9.015" />
    <Parameter name="TX" type="double" value="-63.25" /> <Parameter name="TZ" type="double" value="18.5" />
    <Parameter name="IMAGE_HEIGHT_WIDTH" type="string" value="{{ 800, 1200 }}" />
  </ParameterList>
  <ParameterList name="CAMERA 1">
    <Parameter name="CX" type="double" value="628.6" /> <Parameter name="CY" type="double" value="394.6" />
    <Parameter name="FX" type="double" value="2377.1" /> <Parameter name="FY" type="double" value="2376.9" />
    <Parameter name="K1" type="double" value="0.062" />
    <Parameter name="LENS_DISTORTION_MODEL" type="string" value="{model}" />
    <ParameterList name="rotation_3x3_matrix">
      <Parameter name="ROW 0" type="string" value="{{ 0.0, -1.0, 0.0 }}" />
      <Parameter name="ROW 1" type="string" value="{{ 1.0, 0.0, 0.0 }}" />
      <Parameter name="ROW 2" type="string" value="{{ 0.0, 0.0, 1.0 }}" />
    </ParameterList>
    <Parameter name="TX" type="double" value="64.75" /> <Parameter name="TY" type="double" value="-0.875" />
    <Parameter name="IMAGE_HEIGHT_WIDTH" type="string" value="{{ 700, 1200 }}" />
  </ParameterList>
</ParameterList>
"""

OPENCORR = "\n".join(
    f"\tview{view}_cam_{kind}trinsics.{name} = {value};"
    for view in (1, 2)
    for kind, name, value in (
        ("in", "fx", "6673.25f"), ("in", "fy", "6669.5f"), ("in", "fs", "0.f"), ("in", "cx", "872.5f"),
        ("in", "cy", "580.f"), ("in", "k1", "0.03f"), ("in", "k2", "-1.f"), ("in", "k3", "29.75f"),
        ("in", "k4", "0"), ("in", "p1", "1e-3f"), ("ex", "tx", f"{122 * view - 122}"), ("ex", "ty", "1.5"),
        ("ex", "tz", "17.5"), ("ex", "rx", "0.003"), ("ex", "ry", f"{-0.33 * (view - 1)}"),
        ("ex", "rz", "0.005f"),
    )
)  # fmt: skip

TEXT = "\n".join(
    [f"{v} # a comment" for v in (638.9, 407.3, 2468.5, 2468.25, -0.17, 0.064, 0, 0)]
    + [str(v) for v in (628.6, 394.6, 2377.1, 2376.9, 0.09, 0.062, 0, 0)]
    + ["# pose", "0.09", "-18.03", "-0.0875", "130.75", "-0.61", "17.125", "", "550", "970", ""]
)
