// Sends what the operator holds, thirty times a second, and nothing while he holds nothing; on a
// phone it also leaves the screen to the arm.
(() => {
  'use strict';
  const PERIOD = 33;  // [ms]
  const DEAD_ZONE = 0.12;  // of a stick
  const ROWS = [  // of a task velocity: words and keys for - and +, and the axis
    ['back', 'forward', 'x', 'KeyS', 'KeyW'],
    ['right', 'left', 'y', 'KeyD', 'KeyA'],
    ['down', 'up', 'z', 'KeyF', 'KeyR'],
    ['turn −', 'turn +', 'about x', 'KeyJ', 'KeyL'],
    ['turn −', 'turn +', 'about y', 'KeyK', 'KeyI'],
    ['turn −', 'turn +', 'about z', 'KeyO', 'KeyU'],
  ];
  const KEYS = {};  // code of a key: [row, sign]
  ROWS.forEach(([, , , minus, plus], row) => {
    KEYS[minus] = [row, -1];
    KEYS[plus] = [row, 1];
  });
  const pressed = new Set();  // codes of keys
  let shift = false;
  let jog = null;  // code whose button is held
  let socket = null;
  let held = false;
  let status = null;

  const isNarrow = () => window.matchMedia('(max-width: 36em)').matches;  // viser's own bound

  const letGo = () => {
    pressed.clear();
    shift = false;
    jog = null;
    beat();
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
    const withPad = addGamepad(direction);
    const codes = [...(shift ? pressed : []), ...(jog ? [jog] : [])];
    for (const code of codes) direction[KEYS[code][0]] += KEYS[code][1];
    const holds = (withPad || shift || jog) && document.hasFocus();
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
  for (const name of ['pointerup', 'pointercancel']) {
    window.addEventListener(name, () => {
      jog = null;
      beat();
    }, true);
  }
  window.addEventListener('blur', letGo);
  window.addEventListener('pagehide', letGo);
  document.addEventListener('visibilitychange', letGo);

  const make = (tag, parent, style, text = '') => {
    const element = document.createElement(tag);
    element.style.cssText = style;
    element.textContent = text;
    parent.appendChild(element);
    return element;
  };

  const addButton = (parent, word, code, axis) => {
    const letter = code.slice(-1);
    const element = make('button', parent,
      'flex: 1; padding: 6px 2px; border: 1px solid #228be6; border-radius: 4px; '
      + 'background: white; color: #1c7ed6; font: inherit; touch-action: none; '
      + 'user-select: none; cursor: pointer;', `${word} (${letter})`);
    element.title = `hold to move; or hold Shift + ${letter}`;
    element.setAttribute('aria-label', `hold: ${word} ${axis}`);
    element.addEventListener('pointerdown', (event) => {
      event.preventDefault();
      window.focus();
      jog = code;
      beat();
    });
    element.addEventListener('contextmenu', (event) => event.preventDefault());
  };

  const build = (rows) => {
    const old = document.getElementById('teleop');
    if (old) old.remove();
    if (!rows) return;
    const box = make('details', document.body,
      `position: fixed; ${isNarrow() ? 'z-index: 9; bottom: 58px' : 'z-index: 20; bottom: 12px'}; `
      + 'left: 50%; width: min(300px, 90vw); transform: translateX(-50%); padding: 7px 10px; '
      + 'font: 13px/1.4 system-ui, sans-serif; '
      + 'background: white; border: 1px solid #ced4da; border-radius: 6px; '
      + 'box-shadow: 0 1px 4px #0003;');
    box.id = 'teleop';
    make('summary', box, 'font-weight: 600; cursor: pointer;', 'Jog the tip');
    for (const [minus, plus, axis, back, on] of ROWS.slice(0, rows)) {
      const line = make('div', box, 'display: flex; gap: 6px; align-items: center; margin: 4px 0;');
      addButton(line, minus, back, axis);
      make('span', line, 'width: 52px; text-align: center; color: #666;', axis);
      addButton(line, plus, on, axis);
    }
    make('div', box, 'color: #666; font-size: 12px;',
      'Axes of the base. Hold a button, Shift and the key in brackets, or a shoulder button of a '
      + 'gamepad with its sticks and triggers. Let go, and the arm comes to rest.');
    status = make('div', box, 'color: #c92a2a;');
  };

  const connect = () => {
    socket = new WebSocket(`ws://${location.host}/teleop`);
    socket.addEventListener('message', (event) => {
      const message = JSON.parse(event.data);
      if ('rows' in message) build(message.rows);
      if ('text' in message && status) status.textContent = message.text;
    });
    socket.addEventListener('close', () => {
      letGo();
      setTimeout(connect, 1000);
    });
  };

  // viser begins with its controls open, over the arm; a tap on their bar opens them again.
  const closeControls = (_, observer) => {
    const bar = document.querySelector('[style*="cursor: pointer"][style*="height: 3.5em"]');
    if (!bar) return;
    observer.disconnect();
    bar.click();
  };

  document.addEventListener('DOMContentLoaded', () => {
    connect();
    if (!isNarrow()) return;
    new MutationObserver(closeControls).observe(document.body, { childList: true, subtree: true });
  });
  setInterval(beat, PERIOD);
})();
