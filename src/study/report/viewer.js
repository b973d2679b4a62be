// Makes a viewer of each group of thumbnails: two images, of which a divider shows one to its left and one to its
// right. Without scripts the thumbnails remain.
"use strict";
for (const group of document.querySelectorAll(".images")) {
  const thumbnails = [...group.querySelectorAll(".frame img")];
  const viewer = group.querySelector(".viewer");
  const stage = group.querySelector(".stage");
  const divider = group.querySelector(".divider");
  const [width, height] = [Number(group.dataset.width), Number(group.dataset.height)];
  const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
  const largest = 64;
  // Shares of the stage's size: where the image's corner is, and how many times as large it is.
  let x = 0, y = 0, scale = 1;

  const element = (name, parent, tag = "div") => {
    const made = document.createElement(tag);
    made.className = name;
    return parent.appendChild(made);
  };
  // The right image fills the stage; the left one lies above and is cut at the divider.
  const sides = ["right", "left"].map((side) => {
    const half = element("half", stage);
    const image = element("", half, "img");
    const name = element("name " + side, half);
    const choice = group.querySelector("select." + side);
    thumbnails.forEach((thumbnail, i) => choice.add(new Option(thumbnail.dataset.name, i)));
    const show = () => {
      const chosen = thumbnails[choice.value];
      image.src = chosen.src;
      image.alt = name.textContent = chosen.dataset.name;
    };
    choice.addEventListener("change", show);
    return { half, image, choice, show };
  });
  const [right, left] = sides;
  const line = element("line", stage);
  stage.style.aspectRatio = width + " / " + height;
  // A stage is not higher than the window.
  stage.style.maxWidth = "min(100%, " + 85 * width / height + "vh)";

  const draw = () => {
    const share = Number(divider.value);
    left.half.style.clipPath = "inset(0 " + (100 - share) + "% 0 0)";
    right.half.style.clipPath = "inset(0 0 0 " + share + "%)";
    line.style.left = share + "%";
    x = clamp(x, 1 - scale, 0);
    y = clamp(y, 1 - scale, 0);
    const moved = "translate(" + 100 * x + "%, " + 100 * y + "%) scale(" + scale + ")";
    for (const image of [right.image, left.image, ...thumbnails]) image.style.transform = moved;
    stage.classList.toggle("close", scale > 1);
  };
  const divide = (share) => { divider.value = clamp(share, 0, 100); draw(); };
  const flip = () => divide(divider.value > 50 ? 0 : 100);
  // Keeps the point of the image at (atX, atY) of the stage where it is.
  const zoom = (factor, atX = 0.5, atY = 0.5) => {
    const next = clamp(scale * factor, 1, largest);
    x = atX - (atX - x) * next / scale;
    y = atY - (atY - y) * next / scale;
    scale = next;
    draw();
  };
  const whole = () => { scale = 1; draw(); };
  const move = (right, down) => { x += right; y += down; draw(); };
  const place = (event) => {
    const box = stage.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };

  divider.addEventListener("input", draw);
  group.querySelector(".flip").addEventListener("click", flip);
  group.querySelector(".closer").addEventListener("click", () => zoom(2));
  group.querySelector(".farther").addEventListener("click", () => zoom(0.5));
  group.querySelector(".whole").addEventListener("click", whole);

  let dragged = null;
  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    const at = place(event);
    const near = Math.abs(at[0] - divider.value / 100) * stage.clientWidth < 16;
    dragged = { divides: near || scale === 1, at };
    stage.setPointerCapture(event.pointerId);
    if (dragged.divides) divide(100 * at[0]);
  });
  stage.addEventListener("pointermove", (event) => {
    if (!dragged) return;
    const at = place(event);
    if (dragged.divides) divide(100 * at[0]);
    else move(at[0] - dragged.at[0], at[1] - dragged.at[1]);
    dragged.at = at;
  });
  for (const end of ["pointerup", "pointercancel"]) stage.addEventListener(end, () => { dragged = null; });
  stage.addEventListener("dblclick", (event) => zoom(event.shiftKey ? 0.5 : 2, ...place(event)));
  // Only after a click, so that scrolling the page over the image scrolls the page.
  stage.addEventListener("wheel", (event) => {
    if (document.activeElement !== stage) return;
    event.preventDefault();
    zoom(Math.exp(-0.002 * event.deltaY), ...place(event));
  }, { passive: false });
  stage.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = 0.1;
    const moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    const keys = {
      "+": () => zoom(2), "=": () => zoom(2), "-": () => zoom(0.5), 0: whole, f: flip, F: flip, " ": flip,
      ArrowLeft: () => divide(Number(divider.value) - 2), ArrowRight: () => divide(Number(divider.value) + 2),
    };
    if (event.shiftKey && event.key in moves) move(...moves[event.key]);
    else if (event.key in keys) keys[event.key]();
    else return;
    event.preventDefault();
  });

  // Reference against the last method's image, which is seldom the baseline; then all of it.
  const images = thumbnails.map((thumbnail, i) => i).filter((i) => !thumbnails[i].closest(".errors"));
  left.choice.value = 0;
  right.choice.value = images[images.length - 1];
  for (const side of sides) side.show();
  viewer.hidden = false;
  draw();
}
