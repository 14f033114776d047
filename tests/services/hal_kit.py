"""Pins, a sampler and a servo thread that do what those of LinuxCNC do, as far as the bridge can see."""

BITS = ("arm", "ack", "clear", "beat", "hold")


class _Component:
    def __init__(self, hal, name):
        self.hal, self.name, self.values, self.linked = hal, name, {}, {}
        hal.components.append(self)

    def newpin(self, name, kind, direction):
        self.values[name] = 0.0 if name in "xy" else False

    def ready(self):
        pass

    def exit(self):
        self.hal.components.remove(self)

    def __getitem__(self, name):
        return self.hal.signals[self.linked[name]] if name in self.linked else self.values[name]

    def __setitem__(self, name, value):
        if name in self.linked:
            self.hal.signals[self.linked[name]] = value
        else:
            self.values[name] = value


class _Stream:
    def __init__(self, hal):
        self.hal, self.sampleno = hal, 0

    readable = property(lambda self: bool(self.hal.sampled))

    def read(self):
        self.sampleno, *row = self.hal.sampled.pop(0)
        return tuple(row)


class Hal:
    """A HAL in which a request is applied at once, armed or not, and a beat runs the machine."""

    HAL_FLOAT, HAL_BIT, HAL_OUT, sampler_base = 1, 2, 3, 4

    def __init__(self, **signals):
        self.signals = {"ask-1": 0.0, "ask-2": 0.0} | dict.fromkeys(BITS, False) | signals
        self.components, self.sampled, self.number = [], [], 0
        self.silence, self.dead, self._last = 0, False, None

    def component(self, name):
        return _Component(self, name)

    def stream(self, *_):
        return _Stream(self)

    def get_info_pins(self):
        return [{"NAME": f"{c.name}.{pin}"} for c in self.components for pin in c.values]

    def get_info_signals(self):
        return [{"NAME": name} for name in self.signals]

    def get_value(self, name):
        return self.signals[name]

    def connect(self, pin, signal):
        name, pin = pin.rsplit(".", 1)
        component = next(c for c in self.components if c.name == name)
        self.signals[signal] = component.values[pin]  # as LinuxCNC: the pin that is linked brings its value
        component.linked[pin] = signal

    def disconnect(self, pin):
        pass

    def cycle(self):
        """Let one servo cycle pass."""
        self.silence = 0 if self.signals["beat"] != self._last else self.silence + 1
        self._last = self.signals["beat"]
        self.number += 1
        run = bool(self.signals["arm"]) and not self.dead
        here = (0.0, 0.0) if self.signals["clear"] else (self.signals["ask-1"], self.signals["ask-2"])
        row = (*here, 0.0, *here, self.signals["ask-1"], self.signals["ask-2"], False, run, False, True)
        self.sampled.append((self.number, *row))


class Linuxcnc:
    """The state of a control that is on, homed and idle; what it is told to do is kept."""

    INTERP_IDLE, INTERP_WAITING = 1, 2
    version = "2.9.0"

    def __init__(self):
        self.estop, self.enabled, self.paused, self.interp_state = False, True, False, self.INTERP_IDLE
        self.homed, self.actual_position, self.ini_filename = (1,) * 9, (0.0,) * 9, "lathe.ini"

    def stat(self):
        return self

    def command(self):
        return self

    def poll(self):
        pass
