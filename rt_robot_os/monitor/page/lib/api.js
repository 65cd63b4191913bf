// @ts-check
/** Requests to the server: JSON both ways, the CSRF token on what changes something, clear errors. */

/** @typedef {import('../types').Answers} Answers */

/**
 * What a route answers; of a path that is put together, anything.
 * @template {string} R
 * @typedef {R extends keyof Answers ? Answers[R] : any} Answer
 */

const TIMEOUT_MS = 15000;
// Browsers send no more than 64 KiB of all pages that were left.
const KEPT_CHARACTERS = 8192;

/** What a request was refused with: what happened (message) and what to do (remedy). */
export class ApiError extends Error {
  /**
   * @param {number} status of HTTP; 0: the server did not answer
   * @param {string} text
   * @param {string} remedy
   * @param {string} reason for the page: login, locked, csrf, password; or none
   * @param {Object} codes of text and remedy, as said.js takes them
   */
  constructor(status, text, remedy = '', reason = '', codes = {}) {
    super(text);
    this.status = status;
    this.remedy = remedy;
    this.reason = reason;
    this.codes = codes;
  }
}

export class Api {
  constructor() {
    this.csrf = '';
    /** Called when the server no longer knows who we are. */
    this.onSignedOut = () => {};
    /**
     * Called when the session is locked; the argument: a user waits. Resolves to: unlocked.
     * @type {(isAsked: boolean) => Promise<boolean>}
     */
    this.onLocked = async () => false;
    /** Called when the token of the page is no longer that of the session: get the new one. */
    this.onStale = /** @type {() => Promise<boolean>} */ (async () => false);
  }

  /**
   * Read something.
   * @template {string} P
   * @param {P} path
   * @param {Object} [parameters] of the query; null and undefined are left out
   * @param {{background?: boolean}} [how] background: a timer asks, not a person, so that it does
   *   not keep the session alive
   * @returns {Promise<Answer<`GET ${P}`>>}
   */
  get(path, parameters, how = {}) {
    return this.send('GET', path + query(parameters), undefined,
      how.background ? {'X-Background': '1'} : {});
  }

  /**
   * @template {string} P
   * @param {P} path
   * @param {Object} [body]
   * @returns {Promise<Answer<`POST ${P}`>>}
   */
  post(path, body = {}) {
    return this.send('POST', path, body);
  }

  /**
   * @template {string} P
   * @param {P} path
   * @param {Object} [body]
   * @returns {Promise<Answer<`PUT ${P}`>>}
   */
  put(path, body = {}) {
    return this.send('PUT', path, body);
  }

  /**
   * @template {string} P
   * @param {P} path
   * @param {Object} [body]
   * @returns {Promise<Answer<`PATCH ${P}`>>}
   */
  patch(path, body = {}) {
    return this.send('PATCH', path, body);
  }

  /**
   * @template {string} P
   * @param {P} path
   * @param {Object} [body]
   * @returns {Promise<Answer<`DELETE ${P}`>>}
   */
  delete(path, body) {
    return this.send('DELETE', path, body);
  }

  /**
   * Send a request.
   * @returns {Promise<*>} the JSON of the answer, null for none
   * @throws {ApiError}
   */
  async send(method, path, body, more = {}) {
    try {
      return await this.sendOnce(method, path, body, more);
    } catch (error) {
      if (await this.isHelped(error, method, path)) {
        return this.sendOnce(method, path, body, more);
      }
      throw error;
    }
  }

  /** Whether what a request was refused for is put right, so that it may be sent once more. */
  async isHelped({status, reason}, method, path) {
    if (status === 403 && reason === 'csrf') {
      return this.onStale();
    }
    if (status === 401 && reason === 'locked') {
      return this.onLocked(method !== 'GET');
    }
    if (status === 401 && !path.startsWith('/api/session')) {
      this.onSignedOut();
    }
    return false;
  }

  async sendOnce(method, path, body, more) {
    const headers = {Accept: 'application/json', ...more};
    if (method !== 'GET') {
      headers['X-CSRF-Token'] = this.csrf;
    }
    if (body !== undefined) {
      headers['Content-Type'] = 'application/json';
    }
    const text = body === undefined ? undefined : JSON.stringify(body);
    let answer;
    try {
      answer = await fetch(path, {
        method,
        headers,
        body: text,
        // What was ordered is sent to its end, also when the page is left in that moment.
        keepalive: method !== 'GET' && (text || '').length <= KEPT_CHARACTERS,
        credentials: 'same-origin',
        cache: 'no-store',
        signal: AbortSignal.timeout(TIMEOUT_MS),
      });
    } catch (error) {
      throw new ApiError(0, '');
    }
    const found = await content(answer);
    if (answer.ok) {
      return found;
    }
    const detail = (found && found.detail) || {};
    throw new ApiError(answer.status, detail.text || String(detail.message || answer.status),
      detail.remedy || '', detail.reason || '', detail.codes || {});
  }
}

async function content(answer) {
  try {
    return await answer.json();
  } catch (error) {
    return null;
  }
}

function query(parameters) {
  const found = new URLSearchParams();
  for (const [name, value] of Object.entries(parameters || {})) {
    if (value !== undefined && value !== null) {
      found.set(name, value);
    }
  }
  const text = found.toString();
  return text ? `?${text}` : '';
}
