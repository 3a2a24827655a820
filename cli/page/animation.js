'use strict';
// The animation plays by itself (SMIL): here it is paused, and brought to an instant.
(() => {
  const svg = document.querySelector('svg.animation'), play = document.getElementById('play');
  const at = document.getElementById('at'), shown = document.getElementById('instant');
  if (!svg || !play || !at || !shown) return;
  const [low, high, seconds] = ['low', 'high', 'seconds'].map(key => Number(svg.dataset[key]));

  const show = () => {
    const part = seconds > 0 ? (svg.getCurrentTime() % seconds) / seconds : 0;
    if (document.activeElement !== at || !svg.animationsPaused()) at.value = part;
    shown.textContent = `${(low + part * (high - low)).toPrecision(4)} ${svg.dataset.unit}`;
    requestAnimationFrame(show);
  };

  play.addEventListener('click', () => {
    const paused = svg.animationsPaused();
    if (paused) svg.unpauseAnimations(); else svg.pauseAnimations();
    play.textContent = paused ? 'Pause' : 'Play';
  });
  at.addEventListener('input', () => {
    svg.pauseAnimations();
    play.textContent = 'Play';
    svg.setCurrentTime(Math.min(Number(at.value), 1 - 1e-6) * seconds);
  });
  show();
})();
