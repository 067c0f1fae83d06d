// Folding and filtering; without a script everything is there, unfiltered.
(() => {
  'use strict';
  const cases = [...document.querySelectorAll('details.case')];
  const form = document.querySelector('.filters');
  for (const film of document.querySelectorAll('.film')) {  // a strip, until there is a slider
    const strips = [...film.querySelectorAll('.frames')].map(one => [...one.children]);
    const bar = document.createElement('p');
    const last = strips[0].length - 1;
    bar.className = 'control';
    bar.innerHTML = '<button type="button">play</button> <label>time <input type="range" min="0"'
      + ` max="${last}" value="${last}"></label> <label><input type="checkbox"> all times</label>`;
    const [play, slider, all] = bar.querySelectorAll('button, input');
    const show = () => strips.forEach(frames => frames.forEach((f, k) => f.classList.toggle('now', k === +slider.value)));
    let timer = 0;
    const stop = () => { clearInterval(timer); timer = 0; play.textContent = 'play'; };
    slider.addEventListener('input', () => { stop(); show(); });
    play.addEventListener('click', () => {
      if (timer) { stop(); return; }
      play.textContent = 'stop';
      timer = setInterval(() => { slider.value = (+slider.value + 1) % (last + 1); show(); }, 600);
    });
    all.addEventListener('change', () => { stop(); film.classList.toggle('live', !all.checked); });
    film.prepend(bar);
    film.classList.add('live');
  }
  let before = [];
  addEventListener('beforeprint', () => { before = cases.map(d => d.open); cases.forEach(d => { d.open = true; }); });
  addEventListener('afterprint', () => cases.forEach((d, i) => { d.open = before[i]; }));
  const follow = () => {
    const target = location.hash.length > 1 && document.getElementById(location.hash.slice(1));
    if (!target) return;
    for (let d = target.closest('details'); d; d = d.parentElement.closest('details')) d.open = true;
    target.scrollIntoView();
  };
  addEventListener('hashchange', follow);
  document.addEventListener('click', e => {  // the same link twice changes no hash
    const link = e.target.closest('a[href^="#"]');
    if (link && link.hash === location.hash) follow();
  });
  follow();
  if (!form) return;
  form.hidden = false;
  const rows = new Map([...document.querySelectorAll('table.matrix tbody tr')].map(
    row => [row.querySelector('a').hash.slice(1), row]));
  const filter = () => {
    const words = form.words.value.toLowerCase(), solver = form.solver.value, verdict = form.verdict.value;
    let shown = 0;
    for (const one of cases) {
      const own = JSON.parse(one.dataset.solvers);
      const found = solver ? own[solver] : one.dataset.verdict;
      const keep = one.dataset.name.toLowerCase().includes(words) && (!solver || found)
        && (!verdict || found === verdict || (!solver && Object.values(own).includes(verdict)));
      one.hidden = !keep;
      if (rows.has(one.id)) rows.get(one.id).hidden = !keep;
      shown += keep;
    }
    form.querySelector('output').textContent = shown < cases.length ? `${shown} of ${cases.length} cases` : '';
  };
  form.addEventListener('input', filter);
  form.addEventListener('submit', e => e.preventDefault());
  form.addEventListener('click', e => {
    if (!('fold' in e.target.dataset)) return;
    const open = !!e.target.dataset.fold;
    (open ? document.querySelectorAll('details') : cases).forEach(one => { one.open = open; });
  });
})();
