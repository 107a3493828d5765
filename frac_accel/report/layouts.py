"""Layouts for Foxglove and PlotJuggler: raw, reference, corrected with its band, metrics."""

import dataclasses
import json
import textwrap
import xml.etree.ElementTree as xml

_AXES = "xyz"
_COLOURS = {"raw": "#d62728", "reference": "#7f7f7f", "corrected": "#1f77b4", "± 2u": "#9ac7e8"}
_LATENCY = "#2ca02c"
# Elements of the covariance's diagonal, as a message has them in a row.
_DIAGONAL = {"x": 0, "y": 4, "z": 8}


@dataclasses.dataclass(frozen=True)
class Topics:
    """Where a corrected sensor is to be seen.

    Attributes
    ----------
    namespace : str
        Of the sensor's topics; empty for the root.
    node : str
        Full name of the corrector.
    sensor : str
        Its name where the node has many.
    """

    namespace: str = ""
    node: str = ""
    sensor: str = ""

    @property
    def of_signals(self):
        """Topic by what is on it."""
        space = self.namespace.strip("/")
        prefix = f"/{space}" if space else ""
        return {"raw": f"{prefix}/imu/data_raw", "reference": f"{prefix}/imu/reference",
                "corrected": f"{prefix}/imu/data"}

    def metric(self, name):
        """Topic of a metric."""
        space = self.namespace.strip("/")
        node = self.node or (f"/{space}/corrector" if space else "/corrector")
        sensor = f"{self.sensor}/" if self.sensor else ""
        return f"/{node.strip('/')}/metrics/{sensor}{name}"


def foxglove(topics):
    """Layout for Foxglove of some `Topics`, as text.

    The band is made by a script of the layout, so that nothing is published for it.
    """
    signals, band = topics.of_signals, "/studio_script/corrected_2u"
    panels = {}
    for axis in _AXES:
        paths = [_path(f"{band}.{end}.{axis}", "± 2u", _COLOURS["± 2u"])
                 for end in ("lower", "upper")]
        paths += [_path(f"{topic}.linear_acceleration.{axis}", name, _COLOURS[name])
                  for name, topic in signals.items()]
        panels[f"Plot!acceleration_{axis}"] = _plot(f"Acceleration {axis}", f"{axis} [m/s²]", 2,
                                                    paths)
    panels["Plot!error"] = _plot("Error against the reference", "NRMSE of x", 60, [
        _path(f"{topics.metric(f'x/{name}/nrmse')}.data", f"NRMSE {name}", _COLOURS[name],
              "receiveTime") for name in ("raw", "corrected")])
    panels["Plot!latency"] = _plot("Latency", "latency, 99 % [s]", 60, [
        _path(f"{topics.metric('latency_p99_s')}.data", "latency", _LATENCY, "receiveTime")])
    panels["DiagnosticSummary!diagnostics"] = {
        "foxglovePanelTitle": "Health", "minLevel": 0, "pinnedIds": [], "hardwareIdFilter": "",
        "topicToRender": "/diagnostics", "sortByLevel": True}
    first, second, third, *right = panels
    layout = {"direction": "row", "splitPercentage": 65, "first": _column(first, second, third),
              "second": _column(*right)}
    return json.dumps({
        "configById": panels, "globalVariables": {}, "playbackConfig": {"speed": 1},
        "userNodes": {"band": {"name": "corrected ± 2u",
                               "sourceCode": _script(signals["corrected"], band)}},
        "layout": layout}, indent=2, ensure_ascii=False) + "\n"


def _path(value, label, colour, stamped="headerStamp"):
    return {"timestampMethod": stamped, "value": value, "enabled": True, "label": label,
            "color": colour}


def _plot(title, label, width_s, paths):
    return {"foxglovePanelTitle": title, "paths": paths, "showLegend": True,
            "legendDisplay": "floating", "showPlotValuesInLegend": False, "isSynced": True,
            "showXAxisLabels": True, "showYAxisLabels": True, "xAxisVal": "timestamp",
            "followingViewWidth": width_s, "yAxisLabel": label}


def _column(first, second, third):
    return {"direction": "column", "splitPercentage": 34, "first": first,
            "second": {"direction": "column", "first": second, "second": third}}


def _script(corrected, band):
    ends = {name: ", ".join(
        f"{axis}: a.{axis} {sign} 2 * Math.sqrt(c[{place}])" for axis, place in _DIAGONAL.items())
        for name, sign in (("lower", "-"), ("upper", "+"))}
    return textwrap.dedent(f"""\
        import {{ Input, Message }} from "./types";

        type Vector = {{ x: number; y: number; z: number }};
        type Band = {{ header: Message<"std_msgs/Header">; lower: Vector; upper: Vector }};

        export const inputs = ["{corrected}"];
        export const output = "{band}";

        // two standard uncertainties about each corrected sample, from its covariance
        export default function script(event: Input<"{corrected}">): Band {{
          const a = event.message.linear_acceleration;
          const c = event.message.linear_acceleration_covariance;
          return {{
            header: event.message.header,
            lower: {{ {ends["lower"]} }},
            upper: {{ {ends["upper"]} }},
          }};
        }}
        """)


def plotjuggler(topics):
    """Layout for PlotJuggler of some `Topics`, as text.

    The band is two series that it computes itself, from the corrected samples' covariance.
    """
    signals = topics.of_signals
    root = xml.Element("root")
    window = xml.SubElement(root, "tabbed_widget", name="Main Window", parent="main_window")
    _tab(window, "acceleration", [
        (f"acceleration {axis} [m/s²]",
         [(f"{signals['corrected']} {axis} {sign} 2u", _COLOURS["± 2u"]) for sign in "-+"]
         + [(f"{topic}/linear_acceleration/{axis}", _COLOURS[name])
            for name, topic in signals.items()]) for axis in _AXES])
    _tab(window, "metrics", [
        ("NRMSE of x against the reference",
         [(f"{topics.metric(f'x/{name}/nrmse')}/data", _COLOURS[name])
          for name in ("raw", "corrected")]),
        ("latency, 99 % [s]", [(f"{topics.metric('latency_p99_s')}/data", _LATENCY)])])
    xml.SubElement(window, "currentTabIndex", index="0")
    xml.SubElement(root, "use_relative_time_offset", enabled="1")
    plugins = xml.SubElement(root, "Plugins")
    for plugin in ("DataLoad ROS2 bags", "ROS2 Topic Subscriber"):
        xml.SubElement(xml.SubElement(plugins, "plugin", ID=plugin), "use_header_stamp",
                       value="true")
    equations = xml.SubElement(root, "customMathEquations")
    for place, axis in enumerate(_AXES):
        for sign in "-+":
            _snippet(equations, signals["corrected"], axis, place, sign)
    xml.indent(root, " ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(root, "unicode") + "\n"


def _tab(window, name, plots):
    share = ";".join([f"{1 / len(plots):.4f}"] * len(plots))
    tab = xml.SubElement(window, "Tab", tab_name=name, containers="1")
    splitter = xml.SubElement(xml.SubElement(tab, "Container"), "DockSplitter", orientation="-",
                              count=str(len(plots)), sizes=share)
    for title, curves in plots:
        plot = xml.SubElement(xml.SubElement(splitter, "DockArea", name=title), "plot",
                              style="Lines", mode="TimeSeries", flip_x="false", flip_y="false")
        xml.SubElement(plot, "limitY")
        for curve, colour in curves:
            xml.SubElement(plot, "curve", name=curve, color=colour)


def _snippet(equations, corrected, axis, place, sign):
    snippet = xml.SubElement(equations, "snippet", name=f"{corrected} {axis} {sign} 2u")
    xml.SubElement(snippet, "global")
    xml.SubElement(snippet, "function").text = f"return value {sign} 2 * math.sqrt(v1)"
    xml.SubElement(snippet, "linked_source").text = f"{corrected}/linear_acceleration/{axis}"
    sources = xml.SubElement(snippet, "additional_sources")
    # as PlotJuggler names the elements of a covariance
    xml.SubElement(sources, "v1").text = (
        f"{corrected}/linear_acceleration_covariance[{place};{place}]")
