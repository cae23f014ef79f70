// Sends what the operator holds, thirty times a second, and nothing while he holds nothing.
(() => {
  'use strict';
  const KEYS = __KEYS__;  // code of a key: [row of the task velocity, sign]
  const PERIOD = 33;  // [ms]
  const DEAD_ZONE = 0.12;  // of a stick
  const BUTTONS = [
    ['back', 'forward', 'x', 'KeyS', 'KeyW'],
    ['right', 'left', 'y', 'KeyD', 'KeyA'],
    ['down', 'up', 'z', 'KeyF', 'KeyR'],
    ['turn −', 'turn +', 'about x', 'KeyJ', 'KeyL'],
    ['turn −', 'turn +', 'about y', 'KeyK', 'KeyI'],
    ['turn −', 'turn +', 'about z', 'KeyO', 'KeyU'],
  ];
  const pressed = new Set();  // codes of keys
  let shift = false;
  let pointer = false;  // down on the scene: it may drag the tip or push a link
  let jog = null;  // code whose button is held
  let socket = null;
  let held = false;
  let status = null;

  const letGo = () => {
    pressed.clear();
    shift = false;
    pointer = false;
    jog = null;
    beat();
  };

  const add = (direction, code) => {
    const [row, sign] = KEYS[code];
    direction[row] += sign;
  };

  const addGamepad = (direction) => {
    let holds = false;
    for (const pad of navigator.getGamepads()) {
      if (!pad || pad.buttons.length < 8) continue;
      if (!pad.buttons[4].pressed && !pad.buttons[5].pressed) continue;  // the shoulder buttons
      holds = true;
      const stick = (axis) => {
        const value = pad.axes[axis] || 0;
        return Math.abs(value) < DEAD_ZONE ? 0 : value;
      };
      direction[0] -= stick(1);
      direction[1] -= stick(0);
      direction[2] += pad.buttons[7].value - pad.buttons[6].value;  // the triggers
      direction[4] -= stick(3);
      direction[5] -= stick(2);
    }
    return holds;
  };

  function beat() {
    if (!socket || socket.readyState !== WebSocket.OPEN) return;
    const direction = [0, 0, 0, 0, 0, 0];
    let holds = addGamepad(direction);
    if (shift) {
      holds = true;
      pressed.forEach((code) => add(direction, code));
    }
    if (jog) {
      holds = true;
      add(direction, jog);
    }
    holds = (holds || pointer) && document.hasFocus();
    if (holds) {
      const clipped = direction.map((value) => Math.min(1, Math.max(-1, value)));
      if (socket.bufferedAmount === 0) socket.send(JSON.stringify(clipped));  // no old ones
    } else if (held) {
      socket.send('null');
    }
    held = holds;
  }

  const isText = (target) => /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName || '')
    && target.type !== 'checkbox' && target.type !== 'range';

  window.addEventListener('keydown', (event) => {
    if (isText(event.target)) return;
    shift = event.shiftKey;
    if (!shift || !(event.code in KEYS)) return;
    pressed.add(event.code);
    event.preventDefault();  // without Shift these keys move the camera
    event.stopImmediatePropagation();
  }, true);
  window.addEventListener('keyup', (event) => {
    shift = event.shiftKey;
    pressed.delete(event.code);
  }, true);
  window.addEventListener('pointerdown', (event) => {
    pointer = event.target.tagName === 'CANVAS';
    beat();
  }, true);
  for (const name of ['pointerup', 'pointercancel']) {
    window.addEventListener(name, () => {
      pointer = false;
      jog = null;
      beat();
    }, true);
  }
  window.addEventListener('blur', letGo);
  window.addEventListener('pagehide', letGo);
  document.addEventListener('visibilitychange', letGo);

  const make = (tag, parent, style, text) => {
    const element = document.createElement(tag);
    element.style.cssText = style;
    if (text) element.textContent = text;
    parent.appendChild(element);
    return element;
  };

  const button = (parent, word, code, narrow) => {
    const element = make('button', parent,
      'flex: 1; padding: 6px 2px; border: 1px solid #228be6; border-radius: 4px; '
      + 'background: white; color: #1c7ed6; font: inherit; touch-action: none; '
      + 'user-select: none; cursor: pointer;', narrow ? word : `${word} (${code.slice(-1)})`);
    element.title = `hold to move; or hold Shift + ${code.slice(-1)}`;
    const [row, sign] = KEYS[code];
    element.setAttribute('aria-label', `hold: ${sign > 0 ? '+' : '-'}${'xyzabc'[row]}`);
    element.addEventListener('pointerdown', (event) => {
      event.preventDefault();
      window.focus();
      jog = code;
      beat();
    });
    element.addEventListener('contextmenu', (event) => event.preventDefault());
  };

  const NARROW = window.matchMedia('(max-width: 599px)');
  let rows = 0;

  const build = () => {
    const old = document.getElementById('teleop');
    if (old) old.remove();
    if (!rows) return;
    const narrow = NARROW.matches;
    const box = make('div', document.body,
      'position: fixed; z-index: 20; font: 13px/1.4 system-ui, sans-serif; background: white; '
      + 'border: 1px solid #ced4da; border-radius: 6px; box-shadow: 0 1px 4px #0003; '
      + (narrow ? 'top: 8px; left: 8px; right: 8px;'
        : 'bottom: 12px; left: 50%; width: 300px; margin-left: -150px;'));
    box.id = 'teleop';
    const head = make('button', box, 'width: 100%; padding: 7px; border: 0; border-radius: 6px; '
      + 'background: none; font: inherit; font-weight: 600; cursor: pointer;', 'Jog the tip ▾');
    const body = make('div', box, 'display: none; padding: 0 10px 8px;');
    head.setAttribute('aria-expanded', 'false');
    head.addEventListener('click', () => {
      const opens = body.style.display === 'none';
      body.style.display = opens ? 'block' : 'none';
      head.textContent = opens ? 'Jog the tip ▴' : 'Jog the tip ▾';
      head.setAttribute('aria-expanded', String(opens));
    });
    for (const [minus, plus, axis, back, on] of BUTTONS.slice(0, rows)) {
      const line = make('div', body, 'display: flex; gap: 6px; align-items: center; margin: 4px 0;');
      button(line, minus, back, narrow);
      make('span', line, 'width: 52px; text-align: center; color: #666;', axis);
      button(line, plus, on, narrow);
    }
    make('div', body, 'color: #666; font-size: 12px;',
      narrow ? 'Axes of the base. Hold a button; let go, and the arm comes to rest.'
        : 'Axes of the base. Hold a button, Shift and the key in brackets, or a shoulder button of a '
        + 'gamepad with its sticks and triggers. Let go, and the arm comes to rest.');
    status = make('div', box, 'padding: 0 10px; color: #c92a2a;');
  };

  const connect = () => {
    socket = new WebSocket(`ws://${location.host}/teleop`);
    socket.addEventListener('message', (event) => {
      const message = JSON.parse(event.data);
      if ('rows' in message) {
        rows = message.rows;
        build();
      }
      if ('text' in message && status) status.textContent = message.text;
    });
    socket.addEventListener('close', () => {
      letGo();
      setTimeout(connect, 1000);
    });
  };

  NARROW.addEventListener('change', build);  // a turned phone
  document.addEventListener('DOMContentLoaded', connect);
  setInterval(beat, PERIOD);
})();
