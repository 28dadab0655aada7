"""Program that shows the window of the virtual haptic device: a mouse moves a handle, and an arrow shows the force.

The program has four arguments: the file descriptor of a socket, the radius of the workspace [m], the largest force [N],
and 1 or 0. With 1, the handle returns to the middle when it is released.
"""

import os
import socket
import struct
import sys
import tkinter

FROM_WINDOW, TO_WINDOW = struct.Struct("=4d"), struct.Struct("=6d")
SIZE, BAR, MARGIN = 420, 90, 30
"""Side of the square for x and y, width of the bar for z, and margin around both [px]."""
WHEEL_PARTS = 50
"""Number of notches of the wheel that move the handle by the radius of the workspace."""
PERIOD_MS = 16
WHEEL_RETURN_MS = 300
"""Time from the last notch of the wheel until the handle returns, if `returns` is set [ms]."""
TEXT = "drag: x, y    wheel or right button: z    space: button"


class HandleWindow:
    """Window that shows the workspace from above, with x upwards, and the height z of the handle in a bar.

    Args:
        connection: Socket to the device.
        radius_m: Radius of the workspace [m].
        max_force_n: Force whose arrow is half as long as the workspace's radius [N].
        returns: Whether the handle returns to the middle when it is released.
    """

    def __init__(self, connection: socket.socket, radius_m: float, max_force_n: float, returns: bool) -> None:
        self._connection, self._radius_m, self._max_force_n = connection, radius_m, max_force_n
        self._returns, self._is_sent = returns, True
        connection.setblocking(False)
        self._mouse = [0.0, 0.0, 0.0]
        self._button, self._last = 0.0, (0, 0)
        self._received = b""
        self._scale = (SIZE / 2 - MARGIN) / radius_m
        self._root = root = tkinter.Tk()
        root.title("Virtual haptic device")
        root.resizable(False, False)
        self._canvas = tkinter.Canvas(root, width=SIZE + BAR, height=SIZE + 60, background="white")
        self._canvas.pack()
        self._draw_room()
        for number in (1, 3):
            self._canvas.bind(f"<Button-{number}>", self._press)
        self._canvas.bind("<B1-Motion>", lambda event: self._drag(event, "xy"))
        self._canvas.bind("<B3-Motion>", lambda event: self._drag(event, "z"))
        self._canvas.bind("<ButtonRelease-1>", lambda _: self._release(0, 1))
        self._canvas.bind("<ButtonRelease-3>", lambda _: self._release(2))
        self._canvas.bind("<Button-4>", lambda _: self._turn(1))
        self._canvas.bind("<Button-5>", lambda _: self._turn(-1))
        self._wheel_return: str | None = None
        root.bind("<KeyPress-space>", lambda _: self._hold(1.0))
        root.bind("<KeyRelease-space>", lambda _: self._hold(0.0))
        root.bind("<FocusOut>", lambda _: self._hold(0.0))  # the key's release goes to another window
        root.after(PERIOD_MS, self._update)

    def run(self) -> None:
        """Shows the window until the user closes the window, or the device closes the socket."""
        self._root.mainloop()

    def _draw_room(self) -> None:
        canvas, middle, reach = self._canvas, SIZE / 2, SIZE / 2 - MARGIN
        canvas.create_oval(
            middle - reach, middle - reach, middle + reach, middle + reach, fill="#f2f4f7", outline="#9aa"
        )
        canvas.create_line(middle, MARGIN, middle, SIZE - MARGIN, fill="#dde")
        canvas.create_line(MARGIN, middle, SIZE - MARGIN, middle, fill="#dde")
        canvas.create_text(middle, 14, text="x: forward", fill="#667")
        canvas.create_text(MARGIN + 14, middle - 10, text="y: left", fill="#667")
        x = SIZE + BAR / 2 - 10
        canvas.create_rectangle(x - 8, MARGIN, x + 8, SIZE - MARGIN, fill="#f2f4f7", outline="#9aa")
        canvas.create_text(x, 14, text="z: up", fill="#667")
        canvas.create_text((SIZE + BAR) / 2, SIZE + 40, text=TEXT, fill="#667")
        self._cursor = canvas.create_oval(0, 0, 0, 0, outline="#888", dash=(2, 2))
        self._handle = canvas.create_oval(0, 0, 0, 0, fill="#2a6", outline="")
        self._height = canvas.create_rectangle(0, 0, 0, 0, fill="#2a6", outline="")
        self._arrow = canvas.create_line(0, 0, 0, 0, fill="#d33", width=4, arrow=tkinter.LAST)
        self._lifting = canvas.create_line(0, 0, 0, 0, fill="#d33", width=4, arrow=tkinter.LAST)
        self._force = canvas.create_text((SIZE + BAR) / 2, SIZE + 14, font=("TkDefaultFont", 12, "bold"))

    def _press(self, event: tkinter.Event) -> None:
        self._last = event.x, event.y

    def _drag(self, event: tkinter.Event, axes: str) -> None:
        right, up = (event.x - self._last[0]) / self._scale, (self._last[1] - event.y) / self._scale
        self._last = event.x, event.y
        if axes == "z":
            self._lift(up)
        else:
            self._mouse[0] = self._inside(self._mouse[0] + up)
            self._mouse[1] = self._inside(self._mouse[1] - right)
            self._send()

    def _turn(self, notches: int) -> None:
        self._lift(notches * self._radius_m / WHEEL_PARTS)
        if self._wheel_return is not None:
            self._root.after_cancel(self._wheel_return)
        self._wheel_return = self._root.after(WHEEL_RETURN_MS, self._release, 2)

    def _release(self, *axes: int) -> None:
        if self._returns:
            for axis in axes:
                self._mouse[axis] = 0.0
            self._send()

    def _lift(self, up_m: float) -> None:
        self._mouse[2] = self._inside(self._mouse[2] + up_m)
        self._send()

    def _hold(self, button: float) -> None:
        self._button = button
        self._send()

    def _inside(self, value: float) -> float:
        return min(max(value, -self._radius_m), self._radius_m)

    def _send(self) -> None:
        try:
            self._connection.send(FROM_WINDOW.pack(*self._mouse, self._button))
            self._is_sent = True
        except BlockingIOError:
            self._is_sent = False  # the device is busy; the next update sends the state again
        except OSError:
            self._root.destroy()

    def _update(self) -> None:
        try:
            received = self._connection.recv(65536)
        except BlockingIOError:
            received = None
        except OSError:
            received = b""
        if received == b"":
            self._root.destroy()
            return
        self._received += received or b""
        whole = len(self._received) // TO_WINDOW.size * TO_WINDOW.size
        if whole:
            self._draw(*TO_WINDOW.unpack(self._received[whole - TO_WINDOW.size : whole]))
            self._received = self._received[whole:]
        self._root.after(PERIOD_MS, self._update)
        if not self._is_sent:
            self._send()

    def _draw(self, x: float, y: float, z: float, fx: float, fy: float, fz: float) -> None:
        canvas, middle, scale = self._canvas, SIZE / 2, self._scale
        per_newton = (SIZE / 2 - MARGIN) / 2 / self._max_force_n
        column, row = middle - y * scale, middle - x * scale
        mouse_column, mouse_row = middle - self._mouse[1] * scale, middle - self._mouse[0] * scale
        canvas.coords(self._cursor, mouse_column - 12, mouse_row - 12, mouse_column + 12, mouse_row + 12)
        canvas.coords(self._handle, column - 9, row - 9, column + 9, row + 9)
        canvas.coords(self._arrow, column, row, column - fy * per_newton, row - fx * per_newton)
        bar, level = SIZE + BAR / 2 - 10, middle - z * scale
        canvas.coords(self._height, bar - 14, level - 4, bar + 14, level + 4)
        canvas.coords(self._lifting, bar + 24, level, bar + 24, level - fz * per_newton)
        length = (fx * fx + fy * fy + fz * fz) ** 0.5
        canvas.itemconfigure(self._arrow, state="normal" if (fx * fx + fy * fy) ** 0.5 > 0.02 else "hidden")
        canvas.itemconfigure(self._lifting, state="normal" if abs(fz) > 0.02 else "hidden")
        canvas.itemconfigure(self._force, text=f"force {length:.1f} N")


def main() -> None:
    """Runs the program."""
    number, radius_m, max_force_n, returns = sys.argv[1:]
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # without the real-time priority of the loop
    HandleWindow(socket.socket(fileno=int(number)), float(radius_m), float(max_force_n), returns == "1").run()


if __name__ == "__main__":
    main()
