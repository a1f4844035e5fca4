document.querySelectorAll('.clips').forEach(group=>{
const clips=[...group.querySelectorAll('video')];
const together=()=>clips.forEach(clip=>{clip.currentTime=0;clip.play()});
group.querySelector('button').onclick=together;
if(!matchMedia('(prefers-reduced-motion: reduce)').matches)
new IntersectionObserver((seen,watch)=>{
if(seen.some(one=>one.isIntersecting)){watch.disconnect();together()}}).observe(group)})
